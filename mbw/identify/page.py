"""Page of ``mbw identify``: animated modes, mode indicators, synthesised and measured FRFs.

Motion of a machine's bodies in its measured modes, for pictures.
"""

from html import escape
from pathlib import Path
from typing import Any, cast

import numpy as np

from identification.modal import UNIT_MASS
from identification.result.remarks import lead, list_notes, list_remarks
from identification.result.schema import IdentifiedModesFile
from identification.result.stored_result import IdentificationResult, read_result
from identification.words import DERIVATIVE_ORDER, Complex, Dof, Quantity, WorkbenchError
from mbmodel import MachineGeometry, load_machine, machine_geometry
from mbmodel.geometry.surfaces import TendonLine
from mbw.identify.files import nodes_of
from mbw.identify.sections import hits_data, hits_section, solid_data
from mbw.messages import SCREEN
from mbw.page.html import (
    fill_template,
    pack_complex,
    pack_integers,
    pack_real,
    read_asset,
    warning_boxes,
)
from mbw.page.numbers import force_unit, motion_unit
from mbw.page.picture import picture_data


def render(result: IdentificationResult, geometry: MachineGeometry | None) -> str:
    """Return the HTML page of an identification.

    Args:
        result: result of the identification.
        geometry: surfaces of the machine; None to show sensors and centres of mass alone.
    """
    summary = result.summary
    shared_scripts = ("picture", "modes", "bode")
    page_scripts = ("page", "hits", "levels", "solid", "reconstruction", "frf")
    return fill_template(
        "identify/template.html",
        _data(result, geometry),
        title=escape(f"{summary.campaign}: measured modes"),
        subtitle=escape(
            f"{len(summary.outputs)} outputs, {len(summary.inputs)} inputs, {summary.lines} "
            f"frequency lines {summary.band[0]:g}..{summary.band[1]:g} Hz, {summary.quantity}; "
            f"shapes of {summary.normalisation}"
        ),
        lead=escape(lead(result)),
        warnings=warning_boxes(list_remarks(result), list_notes(result.summary)),
        compared=escape(summary.compared_with),
        column="as drawn" if summary.compared_with.endswith("as drawn") else "reference",
        hits=hits_section(summary.hits),
        levels="" if summary.levels is None else read_asset("identify/levels.html"),
        body_frfs=escape(
            f" The FRFs at the centres of mass are in {summary.body_frfs}."
            if summary.body_frfs
            else ""
        ),
        scripts=[
            *(f"page/{name}.js" for name in shared_scripts),
            *(f"identify/{name}.js" for name in page_scripts),
        ],
        styles=["identify/style.css"],
    )


def render_result(path: Path) -> str:
    """Return the page of a result folder, or of its modes.json.

    Raises:
        InputError: the folder holds no result.
    """
    result = read_result(path)
    model, geometry = result.summary.model, None
    try:
        geometry = (
            machine_geometry(load_machine(Path(model), key=result.summary.keyframe))
            if model
            else None
        )
    except WorkbenchError:
        SCREEN.say(f"{model} cannot be read: the page shows sensors alone")
    return render(result, geometry)


def _force_units(summary: IdentifiedModesFile) -> list[str]:
    """Return the unit of what drives at each input: that of a signal, if one is stated."""
    units = summary.input_units or [""] * len(summary.inputs)
    return [
        unit if unit not in ("", "N", "N m") else force_unit(label)
        for unit, label in zip(units, summary.inputs, strict=True)
    ]


def _data(result: IdentificationResult, geometry: MachineGeometry | None) -> dict[str, object]:
    summary, arrays = result.summary, result.arrays
    count = len(summary.modes)
    channels = [result.layout.parse(label) for label in summary.outputs]
    return {
        "picture": _picture(result, geometry),
        "modes": [_without_shapes(row.model_dump()) for row in summary.modes],
        "outputs": summary.outputs,
        "inputs": summary.inputs,
        "bodies": [result.layout.owner_name(channel) for channel in channels],
        "quantity": summary.quantity,
        "units": {
            "motion": [motion_unit(summary.quantity, label) for label in summary.outputs],
            "force": _force_units(summary),
            "output_as_force": [force_unit(label) for label in summary.outputs],
        },
        "scaled": summary.normalisation == UNIT_MASS,
        "model": {
            "order": DERIVATIVE_ORDER[cast(Quantity, summary.quantity)],
            "decay": float(arrays["decay"]),
            "poles": [[pole.real, pole.imag] for pole in arrays["poles"].tolist()],
            "full": np.flatnonzero(arrays["in_full_matrix"]).tolist(),
            "modal_a": [[a.real, a.imag] for a in arrays["modal_a"].tolist()],
            **{name: pack_complex(arrays[name].T) for name in ("shapes", "participation")},
            **{name: pack_real(arrays[name]) for name in ("lower", "upper")},
        },
        "frf": {
            "freq": pack_real(arrays["freq_hz"]),
            "measured": pack_complex(arrays["measured"].transpose(1, 2, 0)),
            "noise": pack_real(arrays["noise_sd"].transpose(1, 2, 0)),
            "is_measured": pack_integers(arrays["is_measured"]),
            **_cell_data(arrays),
        },
        "error": {
            name: pack_real(arrays[f"channel_{name}"])
            for name in ("error", "noise", "frac", "reciprocal_error")
        },
        "indicators": _indicators(arrays),
        "mac": pack_real(arrays["auto_mac"][:count, :count]),
        "other": _reference_data(result),
        "comac": {
            "values": pack_real(arrays["comac_solid"]),
            "known": pack_integers(arrays["is_solid"]),
        },
        "solid": [solid_data(row) for row in summary.solid],
        "hits": hits_data(summary.hits, arrays),
        "levels": None if summary.levels is None else summary.levels.model_dump(),
    }


def _cell_data(arrays: dict[str, Any]) -> dict[str, object]:
    """Return coherence and rigid-body reconstruction of each FRF; empty if no FRF has it."""
    coherence, solid = (arrays[name].transpose(1, 2, 0) for name in ("coherence", "as_solid"))
    return {
        "coherence": pack_real(coherence) if arrays["has_coherence"].any() else "",
        "has_coherence": pack_integers(arrays["has_coherence"]),
        "as_solid": pack_complex(solid) if arrays["has_solid"].any() else "",
        "has_solid": pack_integers(arrays["has_solid"]),
    }


def _without_shapes(row: dict[str, Any]) -> dict[str, object]:
    return {name: value for name, value in row.items() if "shape" not in name}


def _indicators(arrays: dict[str, Any]) -> dict[str, object]:
    """Return the mode indicators, and the poles of all model orders inside the band."""
    freq = arrays["diagram_freq_hz"]
    shown = (freq >= arrays["freq_hz"][0]) & (freq <= arrays["freq_hz"][-1])
    return {
        "cmif": pack_real(arrays["cmif"].T),
        "mmif": pack_real(arrays["mmif"].T),
        "order": pack_integers(arrays["diagram_order"][shown]),
        "kind": pack_integers(arrays["diagram_kind"][shown]),
        "freq": pack_real(freq[shown]),
        "damping": pack_real(arrays["diagram_damping"][shown]),
    }


def _reference_data(result: IdentificationResult) -> dict[str, object]:
    arrays = result.arrays
    return {
        "name": result.summary.compared_with,
        "freq": arrays["other_freq_hz"].tolist(),
        "damping": arrays["other_damping"].tolist(),
        "mac": pack_real(arrays["other_mac"]),
        "pairs": arrays["other_pairs"].tolist(),
        "comac": {
            "values": pack_real(arrays["comac_other"]),
            "known": pack_integers(arrays["in_other"] * bool(len(arrays["other_pairs"]))),
        },
    }


def _picture(result: IdentificationResult, geometry: MachineGeometry | None) -> dict[str, object]:
    layout = result.layout
    nodes = nodes_of(result)
    picture = picture_data(layout, geometry or sensor_spokes(result), body_motion(result))
    picture["points"] = [
        point
        for point in picture["points"]  # type: ignore[attr-defined]
        if point["kind"] == "hammer"
    ]
    picture["sensors"] = {
        "names": [f"node {node}" for node in nodes.nodes],
        "places": pack_real(nodes.positions),
        "vectors": pack_complex(nodes.values.transpose(2, 0, 1)),
    }
    return picture


def body_motion(result: IdentificationResult) -> Complex:
    """Return the motion of each centre of mass; (n_mode, 6 n_body).

    It is zero for a body that lacks a direction.
    """
    layout, summary = result.layout, result.summary
    motion = np.zeros((6 * len(layout.bodies), len(summary.modes)), complex)
    for label, shape in zip(summary.body_directions, result.arrays["body_shapes"], strict=True):
        dof = Dof.parse(label)
        if dof.point not in summary.undetermined_bodies:
            motion[6 * layout.bodies.index(dof.point) + dof.axis] = shape
    return motion.T


def sensor_spokes(result: IdentificationResult) -> MachineGeometry:
    """Return lines from each centre of mass to its sensors, for a machine without surfaces."""
    layout = result.layout
    channels = [layout.parse(label) for label in result.summary.outputs]
    points = list(dict.fromkeys(dof.point for dof in channels if dof.point in layout.points))
    lines = []
    for body, name in enumerate(layout.bodies):
        places = [
            layout.positions[layout.points.index(point)]
            for point in points
            if layout.body_name(point) == name
        ]
        path = [part for place in places for part in (layout.centres[body], place)]
        if path:
            lines.append(TendonLine(name, np.array(path), (name,) * len(path), None))
    return MachineGeometry((), tuple(lines), ())
