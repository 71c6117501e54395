"""The three texts of a campaign: the drawing as MJCF, the campaign and the answer as TOML."""

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import asdict

from truth.draw import Tolerance
from truth.effects import Answer
from truth.station import GROUND, Stage, Station

MESH_FOLDER = "meshes"
_UNITS = {
    "com": "m",
    "joint_position": "m",
    "sensor_angle": "rad",
    "sensor_position": "m",
    "hammer_angle": "rad",
    "hammer_position": "m",
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


def campaign_toml(*, model: str, file: str, level: float, averages: int, given: Tolerance) -> str:
    """Return the campaign's description with one test and every tolerance."""
    lines = [
        f'model = "{model}"',
        "",
        "[[test]]",
        f'file = "{file}"',
        f"level = {float(level)!r}  # N, peak of the impacts",
        f"averages = {averages}",
        "",
        "[tolerance]  # one standard deviation",
    ]
    for name, value in asdict(given).items():
        unit = f"  # {_UNITS[name]}" if name in _UNITS else ""
        lines.append(f"{name} = {value!r}{unit}")
    return "\n".join(lines) + "\n"


def answer_toml(answer: Answer, salt: str) -> str:
    """Return the answer; the salt in front keeps its hash from being guessed by trial."""
    lines = [f"# salt {salt}"]
    for key in ("effect", "location", "dof"):
        if value := getattr(answer, key):
            # A JSON string is a TOML string, whatever characters a body's name has.
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    lines += ["", "[parameters]"]
    lines += [f"{name} = {float(value)!r}" for name, value in answer.parameters.items()]
    return "\n".join(lines) + "\n"


def _body(parent: ET.Element, stage: Stage) -> ET.Element:
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
