"""The page of ``mbw identify``: modes in motion, indicators, synthesis beside measurement."""

from html import escape
from typing import Any, cast

import numpy as np

from identification.modal import UNIT_MASS
from identification.words import ORDER, Complex, Dof, Layout, Quantity
from mbmodel import Looks
from mbmodel.geometry.surfaces import Line
from mbw.identify.files import nodes_of
from mbw.identify.hits import hits_data, hits_section
from mbw.identify.remarks import lead, remarks
from mbw.identify.result import Result
from mbw.identify.solid import solid_data
from mbw.page.html import fill, packed, packed_complex, packed_integers, warnings
from mbw.page.numbers import UNITS
from mbw.page.picture import picture


def render(result: Result, looks: Looks | None) -> str:
    """The HTML of a modal model.

    Args:
        result: what was found.
        looks: of the machine; None to show sensors and centres of mass alone.
    """
    summary = result.summary
    shared = ("picture", "modes", "bode")
    own = ("page", "hits", "solid", "frf")
    return fill(
        "identify/template.html",
        _data(result, looks),
        title=escape(f"{summary.campaign}: measured modes"),
        subtitle=escape(
            f"{len(summary.outputs)} outputs, {len(summary.inputs)} inputs, {summary.lines} lines "
            f"{summary.band[0]:g}..{summary.band[1]:g} Hz, {summary.quantity}; shapes of "
            f"{summary.normalisation}"
        ),
        lead=escape(lead(result)),
        warnings=warnings(remarks(result)),
        compared=escape(summary.compared_with),
        column="drawn" if summary.compared_with.endswith("as drawn") else "other",
        hits=hits_section(summary.hits),
        scripts=[*(f"page/{name}.js" for name in shared), *(f"identify/{name}.js" for name in own)],
        styles=["identify/style.css"],
    )


def _data(result: Result, looks: Looks | None) -> dict[str, object]:
    summary, arrays = result.summary, result.arrays
    count = len(summary.modes)
    return {
        "picture": _picture(result, looks),
        "modes": [_mode(row.model_dump()) for row in summary.modes],
        "outputs": summary.outputs,
        "inputs": summary.inputs,
        "bodies": [result.layout.body_name(Dof.parse(label).point) for label in summary.outputs],
        "quantity": summary.quantity,
        "unit": UNITS[summary.quantity][0],
        "scaled": summary.normalisation == UNIT_MASS,
        "model": {
            "order": ORDER[cast(Quantity, summary.quantity)],
            "decay": float(arrays["decay"]),
            "poles": [[pole.real, pole.imag] for pole in arrays["poles"].tolist()],
            "full": np.flatnonzero(arrays["in_full_matrix"]).tolist(),
            "modal_a": [[a.real, a.imag] for a in arrays["modal_a"].tolist()],
            **{name: packed_complex(arrays[name].T) for name in ("shapes", "participation")},
            **{name: packed(arrays[name]) for name in ("lower", "upper")},
        },
        "frf": {
            "freq": packed(arrays["freq_hz"]),
            "measured": packed_complex(arrays["measured"].transpose(1, 2, 0)),
            "noise": packed(arrays["noise_sd"].transpose(1, 2, 0)),
            "is_measured": packed_integers(arrays["is_measured"]),
            **_beside(arrays),
        },
        "error": {
            name: packed(arrays[f"channel_{name}"])
            for name in ("error", "noise", "frac", "reciprocal_error")
        },
        "indicators": _indicators(arrays),
        "mac": packed(arrays["auto_mac"][:count, :count]),
        "other": _other(result),
        "comac": {
            "values": packed(arrays["comac_solid"]),
            "known": packed_integers(arrays["is_solid"]),
        },
        "solid": [solid_data(row) for row in summary.solid],
        "hits": hits_data(summary.hits, arrays),
    }


def _beside(arrays: dict[str, Any]) -> dict[str, object]:
    """Coherence and rigid reconstruction of each FRF; nothing where no FRF has it."""
    coherence, solid = (arrays[name].transpose(1, 2, 0) for name in ("coherence", "as_solid"))
    return {
        "coherence": packed(coherence) if arrays["has_coherence"].any() else "",
        "has_coherence": packed_integers(arrays["has_coherence"]),
        "as_solid": packed_complex(solid) if arrays["has_solid"].any() else "",
        "has_solid": packed_integers(arrays["has_solid"]),
    }


def _mode(row: dict[str, Any]) -> dict[str, object]:
    return {name: value for name, value in row.items() if "shape" not in name}


def _indicators(arrays: dict[str, Any]) -> dict[str, object]:
    """Singular values and the poles of every order that lie in the band."""
    freq = arrays["diagram_freq_hz"]
    shown = (freq >= arrays["freq_hz"][0]) & (freq <= arrays["freq_hz"][-1])
    return {
        "cmif": packed(arrays["cmif"].T),
        "mmif": packed(arrays["mmif"].T),
        "order": packed_integers(arrays["diagram_order"][shown]),
        "kind": packed_integers(arrays["diagram_kind"][shown]),
        "freq": packed(freq[shown]),
        "damping": packed(arrays["diagram_damping"][shown]),
    }


def _other(result: Result) -> dict[str, object]:
    arrays = result.arrays
    return {
        "name": result.summary.compared_with,
        "freq": arrays["other_freq_hz"].tolist(),
        "damping": arrays["other_damping"].tolist(),
        "mac": packed(arrays["other_mac"]),
        "pairs": arrays["other_pairs"].tolist(),
        "comac": {
            "values": packed(arrays["comac_other"]),
            "known": packed_integers(arrays["in_other"] * bool(len(arrays["other_pairs"]))),
        },
    }


def _picture(result: Result, looks: Looks | None) -> dict[str, object]:
    layout = result.layout
    nodes = nodes_of(result)
    found = picture(layout, looks or _spokes(layout, result), _body_motion(result))
    found["points"] = [
        point
        for point in found["points"]  # type: ignore[attr-defined]
        if point["kind"] == "hammer"
    ]
    found["sensors"] = {
        "names": [f"node {node}" for node in nodes.nodes],
        "places": packed(nodes.places),
        "vectors": packed_complex(nodes.values.transpose(2, 0, 1)),
    }
    return found


def _body_motion(result: Result) -> Complex:
    """Motion of each centre of mass, zero for bodies that lack a direction; (n_mode, 6 n_body)."""
    layout, summary = result.layout, result.summary
    motion = np.zeros((6 * len(layout.bodies), len(summary.modes)), complex)
    for label, shape in zip(summary.body_directions, result.arrays["body_shapes"], strict=True):
        dof = Dof.parse(label)
        if dof.point not in summary.undetermined_bodies:
            motion[6 * layout.bodies.index(dof.point) + dof.axis] = shape
    return motion.T


def _spokes(layout: Layout, result: Result) -> Looks:
    """Lines from each centre of mass to its sensors, where no surface is known."""
    points = list(dict.fromkeys(Dof.parse(label).point for label in result.summary.outputs))
    lines = []
    for body, name in enumerate(layout.bodies):
        places = [
            layout.positions[layout.points.index(point)]
            for point in points
            if layout.body_name(point) == name
        ]
        path = [part for place in places for part in (layout.centres[body], place)]
        if path:
            lines.append(Line(name, np.array(path), (name,) * len(path), None))
    return Looks((), tuple(lines), ())
