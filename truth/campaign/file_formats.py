"""Files of a campaign: drawing as MJCF, campaign and answer as TOML, FRFs as an array file.

Write FRFs and coherences as a universal file: dataset 164 once, then datasets 58b.

58b is dataset 58 with an ASCII header of eleven lines and little-endian binary data behind it.
Each FRF (function type 4, single complex) is followed by its coherence (type 6, single real), if
there is one.
"""

import io
import json
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from truth.campaign.cause import Cause, Draws
from truth.campaign.draw import Tolerances
from truth.campaign.measure import Measurement
from truth.campaign.protocol import Protocol, Take
from truth.effects import Answer
from truth.machine.springs import ClosedLoop
from truth.machine.station import GROUND, StageBody, Station

MESH_FOLDER = "meshes"
MODEL_FOLDER = "model"  # of a user's own MJCF with all that it reads
_UNITS = {
    "com": "m",
    "joint_position": "m",
    "sensor_angle": "rad",
    "sensor_position": "m",
    "hammer_angle": "rad",
    "hammer_position": "m",
    "sensor_delay": "s",
    "hammer_delay": "s",
}


def model_xml(drawing: Station) -> str:
    """Return the drawing as MJCF that any viewer opens; all positions in world axes."""
    root = ET.Element("mujoco", model=drawing.name)
    compiler = ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    if drawing.meshes:
        compiler.set("meshdir", MESH_FOLDER)
    ET.SubElement(root, "option", gravity="0 0 0", timestep="0.0002")
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "headlight", ambient="0.4 0.4 0.4", diffuse="0.5 0.5 0.5")
    default = ET.SubElement(root, "default")
    ET.SubElement(default, "site", size="0.012", rgba="0.85 0.1 0.1 1")
    if drawing.meshes:
        asset = ET.SubElement(root, "asset")
        for mesh in drawing.meshes:
            ET.SubElement(asset, "mesh", dict(mesh.attributes), name=mesh.name, file=mesh.file)
    elements = {GROUND: ET.SubElement(root, "worldbody")}
    for index, stage in enumerate(drawing.stages):
        elements[index] = _body(elements[stage.parent], stage)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def campaign_toml(
    *,
    model: str,
    files: tuple[Take, ...],
    averages: int,
    given: Tolerances,
    loops: tuple[ClosedLoop, ...] = (),
) -> str:
    """Return the campaign's description with every test, control loop and tolerance."""
    lines = ["format = 1", f'model = "{model}"', ""]
    for take in files:
        lines += [
            "[[test]]",
            f'file = "{take.file}"',
            *(
                []
                if take.level <= 0
                else [f"level = {float(take.level)!r}  # N, peak of the impacts"]
            ),
            *_stated_lines(take, averages),
            *([f'setup = "{take.setup}"'] if take.setup else []),
            "",
        ]
    lines += [loop.table for loop in loops]
    lines.append("[tolerance]  # one standard deviation")
    for name, value in asdict(given).items():
        unit = f"  # {_UNITS[name]}" if name in _UNITS else ""
        lines.append(f"{name} = {value!r}{unit}")
    return "\n".join(lines) + "\n"


def _stated_lines(take: Take, averages: int) -> list[str]:
    """Return what campaign.toml says of a file: its averages, and what an array does not say."""
    if take.test is None:
        return [f"averages = {averages}"]
    stated = take.test.stated
    lines = [f"averages = {stated.averages}"] if stated.averages > 1 else []
    lines += [f"hammer = {_quote(stated.hammer)}"] if stated.hammer else []
    names = ", ".join(map(_quote, stated.channels))
    return [
        *lines,
        f"channels = [{names}]",
        f"references = [{_quote(stated.reference)}]",
        'quantity = "accelerance"',
        'unit = "m/s^2/N"',
    ]


def answer_toml(  # what is found, and how it was drawn
    answers: tuple[Answer, ...],
    draws: Draws,
    cause: Cause,
    protocol: Protocol,
    machine: str,
    salt: str,
) -> str:
    """Return the answer; the salt in front keeps its hash from being guessed by trial.

    One effect or none stands by itself, of several each has its table ``[[cause]]``. How the case
    was drawn comes last, in ``[drawn]``.
    """
    ratios = [drawn.ratio for drawn in draws.drawn]
    lines = [f"# salt {salt}"]
    if not answers:
        lines += ['effect = "none"', "", "[parameters]"]
    elif len(answers) == 1:
        lines += _one_answer(answers[0], ratios[0], "parameters")
    else:
        lines += ['effect = "several"']
        for answer, ratio in zip(answers, ratios, strict=True):
            lines += ["", "[[cause]]", *_one_answer(answer, ratio, "cause.parameters")]
    lines += ["", "[drawn]", f"machine = {json.dumps(machine, ensure_ascii=False)}"]
    lines += [f'kind = "{cause.kind}"'] if cause.kind else []
    lines += [f"mistuned = {json.dumps(cause.mistuned)}", f"discarded = {draws.discarded}"]
    for name, value in asdict(replace(protocol, measured=None)).items():
        if value is not None:
            lines.append(f"{name} = {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def dirt_toml(items: tuple[Answer, ...], per_cent: float, scale: float) -> str:
    """Return what an answer says of the background of small imperfections; empty without one.

    Args:
        items: the imperfections, as the effects of the catalogue that are nearest to them.
        per_cent: part of the motion that they leave of a re-tuned machine.
        scale: their size over that of a good machine.
    """
    if not items:
        return ""
    lines = ["", "[dirt]", f"per_cent = {float(per_cent)!r}", f"scale = {float(scale)!r}"]
    for item in items:
        lines += ["", "[[dirt.item]]", f"effect = {_quote(item.effect)}"]
        lines += [f"location = {_quote(item.location)}"]
        lines += [f"dof = {_quote(item.dof)}"] if item.dof else []
    return "\n".join(lines) + "\n"


def _quote(text: str) -> str:
    """Return a TOML string; a JSON string is one, whatever characters a body's name has."""
    return json.dumps(text, ensure_ascii=False)


def _one_answer(answer: Answer, ratio: float | None, table: str) -> list[str]:
    lines = []
    for key in ("effect", "location", "dof", "kind"):
        if value := getattr(answer, key):
            # A JSON string is a TOML string, whatever characters a body's name has.
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    if ratio is not None:
        lines.append(f"ratio = {float(ratio)!r}  # what survives a refit, over the noise")
    lines += ["", f"[{table}]"]
    for name, value in answer.parameters.items():
        numbers = [float(part) for part in value] if isinstance(value, tuple) else float(value)
        lines.append(f"{name} = {numbers!r}")
    return lines


def _body(parent: ET.Element, stage: StageBody) -> ET.Element:
    body = ET.SubElement(parent, "body", name=stage.name)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = stage.inertia.tolist()
    ET.SubElement(
        body,
        "inertial",
        pos=_numbers(stage.com),
        mass=_numbers([stage.mass]),
        fullinertia=_numbers([xx, yy, zz, xy, xz, yz]),
    )
    for joint in stage.joints:
        ET.SubElement(
            body,
            "joint",
            name=joint.name,
            type=joint.kind,
            axis=_numbers(joint.axis),
            pos=_numbers(joint.position),
            stiffness=_numbers([joint.stiffness]),
            damping=_numbers([joint.damping]),
        )
    for shape in stage.shapes:
        ET.SubElement(body, "geom", dict(shape.attributes))
    for sensor in stage.sensors:
        ET.SubElement(body, "site", name=f"acc{sensor.node}", pos=_numbers(sensor.position))
    for hit in stage.hit_points:
        ET.SubElement(body, "site", name=f"hit{hit.node}", pos=_numbers(hit.position))
    return body


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def array_bytes(measurement: Measurement) -> bytes:
    """Return the content of an .npz: frequencies, FRFs, their coherence if there is one, format."""
    arrays = {"freq_hz": measurement.freq_hz, "frf": measurement.frf, "format": np.array(1)}
    if measurement.coherence is not None:
        arrays["coherence"] = measurement.coherence
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


_FRF_CODE, _COHERENCE_CODE = 4, 6
_SINGLE_REAL, _SINGLE_COMPLEX = 2, 5
_NO_QUANTITY, _ACCELERATION, _EXCITATION, _FREQUENCY = 0, 12, 13, 18
_DELIMITER = f"{-1:6d}\n".encode("ascii")


def uff_bytes(measurement: Measurement) -> bytes:
    """Return the file's content; the values are rounded to single precision."""
    parts = [_units()]
    for column, reference in enumerate(measurement.references):
        for row, response in enumerate(measurement.responses):
            pairs = [(_FRF_CODE, measurement.frf[:, row, column].astype("<c8"))]
            if measurement.coherence is not None:
                pairs.append((_COHERENCE_CODE, measurement.coherence[:, row, column].astype("<f4")))
            for kind, values in pairs:
                spacing = float(measurement.freq_hz[1] - measurement.freq_hz[0])
                start = float(measurement.freq_hz[0])
                parts.append(_function(kind, values, response, reference, (start, spacing)))
    return b"".join(parts)


def _units() -> bytes:
    """Return dataset 164: SI, temperatures absolute, all factors 1."""
    unit, offset = (f"{value:25.16E}".replace("E", "D") for value in (1.0, 273.15))
    lines = (f"{164:6d}", f"{1:10d}{'SI: Meter (newton)':<20}{2:10d}", unit + unit + unit, offset)
    return _DELIMITER + "".join(f"{line}\n" for line in lines).encode("ascii") + _DELIMITER


def _function(
    kind: int,
    values: NDArray[np.complex64] | NDArray[np.float32],
    response: tuple[int, int],
    reference: tuple[int, int],
    abscissa: tuple[float, float],
) -> bytes:
    """Return one dataset 58b; the points are (node, direction), the abscissa (start, spacing)."""
    is_frf = kind == _FRF_CODE
    data = values.tobytes()
    if len(data) != values.size * struct.calcsize("<ff" if is_frf else "<f"):
        raise TypeError(f"dataset 58b: {values.dtype} is not single precision")
    over = (_ACCELERATION, "Acceleration", "m/s^2") if is_frf else (_NO_QUANTITY, "NONE", "NONE")
    under = (_EXCITATION, "Force", "N") if is_frf else (_NO_QUANTITY, "NONE", "NONE")
    header = (
        f"{58:6d}b{1:6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}",
        f"{'accelerance' if is_frf else 'coherence':<80}",
        *[f"{'NONE':<80}"] * 4,
        f"{kind:5d}{0:10d}{1:5d}{0:10d} {'NONE':>10}{response[0]:10d}{response[1]:4d}"
        f" {'NONE':>10}{reference[0]:10d}{reference[1]:4d}",
        f"{_SINGLE_COMPLEX if is_frf else _SINGLE_REAL:10d}{values.size:10d}{1:10d}"
        f"{abscissa[0]:13.5e}{abscissa[1]:13.5e}{0:13.5e}",
        _axis(_FREQUENCY, "Frequency", "Hz"),
        _axis(*over),
        _axis(*under),
        _axis(_NO_QUANTITY, "NONE", "NONE"),
    )
    ascii_lines = "".join(f"{line}\n" for line in header).encode("ascii")
    return _DELIMITER + ascii_lines + data + b"\n" + _DELIMITER


def _axis(data_type: int, label: str, unit: str) -> str:
    return f"{data_type:10d}{0:5d}{0:5d}{0:5d} {label:<20} {unit:<20}"
