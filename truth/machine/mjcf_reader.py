"""Read a nominal station from MJCF: rigid bodies, springs and dampers, places of sensors.

Only what this virtual machine can honour is accepted. An element or attribute that would change
the mechanics in another way is refused by name, never passed over; what is only for the eye is.
"""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Literal

import numpy as np

from truth.errors import TruthError
from truth.machine.station import (
    GROUND,
    HitPoint,
    Joint,
    MeshFile,
    Real,
    Sensor,
    Shape,
    StageBody,
    Station,
)

_WITHOUT_EFFECT = {"visual", "statistic", "light", "camera", "custom", "size"}
_ALLOWED = {
    "mujoco": {"model"},
    "compiler": {"angle", "autolimits", "meshdir"},
    "asset": set[str](),
    "mesh": {"name", "file", "scale", "refpos", "refquat", "inertia", "smoothnormal"},
    "option": {"gravity", "timestep", "integrator", "iterations", "solver", "tolerance"},
    "worldbody": set[str](),
    "body": {"name", "pos"},
    "inertial": {"pos", "mass", "diaginertia", "fullinertia"},
    "joint": {"name", "type", "axis", "pos", "stiffness", "damping", "group"},
    "site": {"name", "pos", "size", "rgba", "type", "group"},
}
_ALLOWED_JOINTS: dict[str, Literal["slide", "hinge"]] = {"slide": "slide", "hinge": "hinge"}
_GEOM_SHAPES = {"sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"}


def read_station(path: Path) -> Station:
    """Read the nominal station.

    Args:
        path: an MJCF file. Bodies may be shifted by ``pos`` but not turned; gravity must be zero.

    Raises:
        TruthError: the file is missing, no MJCF, or holds what would not be honoured.
    """
    try:
        root = ET.parse(path).getroot()
    except OSError as error:
        raise TruthError(f"{path}: cannot be read ({error.strerror}); give an MJCF file") from error
    except ET.ParseError as error:
        raise TruthError(f"{path}: is not XML ({error}); give an MJCF file") from error
    if root.tag != "mujoco":
        raise TruthError(f"{path}: starts with <{root.tag}>; an MJCF file starts with <mujoco>")
    _check(root, children={"compiler", "option", "default", "asset", "worldbody"})
    for compiler in root.findall("compiler"):
        _check(compiler, children=set())
    _check_gravity(root)
    defaults = _geom_defaults(root)
    _check_angles(root)
    meshes = _read_meshes(root, path)
    stages: list[StageBody] = []
    for world in root.findall("worldbody"):
        _check(world, children={"body", "geom", "site"})
        for site in world.findall("site"):
            if re.search(r"\d$", site.get("name", "")):
                raise TruthError(f"{_label(site)}: it sits on the ground; put it into a body")
        for body in world.findall("body"):
            _read_body(body, GROUND, np.zeros(3), defaults, stages)
    _check_mesh_names(root, meshes)
    return Station(root.get("model", "station"), tuple(stages), meshes)


def _read_body(
    body: ET.Element,
    parent: int,
    parent_origin: Real,
    defaults: dict[str, str],
    stages: list[StageBody],
) -> None:
    _check(body, children={"inertial", "joint", "geom", "site", "body"})
    origin = parent_origin + _vector(body, "pos", "0 0 0")
    inertials = body.findall("inertial")
    if len(inertials) != 1:
        raise TruthError(f"{_label(body)}: it needs exactly one <inertial>, got {len(inertials)}")
    _check(inertials[0], children=set(), owner=body)
    sensors, hit_points = _read_sites(body, origin)
    stages.append(
        StageBody(
            name=_name(body),
            parent=parent,
            mass=_number(inertials[0], "mass", None),
            com=origin + _vector(inertials[0], "pos", "0 0 0"),
            inertia=_inertia(inertials[0], body),
            joints=tuple(_read_joint(joint, origin) for joint in body.findall("joint")),
            sensors=sensors,
            hit_points=hit_points,
            shapes=tuple(_shape(geom, origin, defaults) for geom in body.findall("geom")),
        )
    )
    index = len(stages) - 1
    for child in body.findall("body"):
        _read_body(child, index, origin, defaults, stages)


def _read_joint(joint: ET.Element, origin: Real) -> Joint:
    _check(joint, children=set())
    kind = joint.get("type", "hinge")
    if kind not in _ALLOWED_JOINTS:
        raise TruthError(f"{_label(joint)}: type {kind!r} is not handled; use slide and hinge")
    return Joint(
        name=_name(joint),
        kind=_ALLOWED_JOINTS[kind],
        axis=_vector(joint, "axis", "0 0 1"),
        position=origin + _vector(joint, "pos", "0 0 0"),
        stiffness=_number(joint, "stiffness", "0"),
        damping=_number(joint, "damping", "0"),
    )


def _read_sites(body: ET.Element, origin: Real) -> tuple[tuple[Sensor, ...], tuple[HitPoint, ...]]:
    sensors: list[Sensor] = []
    hit_points: list[HitPoint] = []
    for site in body.findall("site"):
        _check(site, children=set())
        match = re.fullmatch(r"(acc|hit)(\d+)", site.get("name", ""))
        position = origin + _vector(site, "pos", "0 0 0")
        if match and match[1] == "acc":
            sensors.append(Sensor(node=int(match[2]), position=position))
        elif match:
            hit_points.append(HitPoint(node=int(match[2]), position=position))
        elif re.search(r"\d$", site.get("name", "")):
            # Its number would be read as a measuring point that this test does not have.
            raise TruthError(f"{_label(site)}: call it acc<node> or hit<node>, or drop its number")
    return tuple(sensors), tuple(hit_points)


def _shape(geom: ET.Element, origin: Real, defaults: dict[str, str]) -> Shape:
    attributes = {**defaults, **geom.attrib}
    if attributes.get("type", "sphere") not in _GEOM_SHAPES:
        raise TruthError(f"{_label(geom)}: type {attributes['type']!r} is not handled; use a mesh")
    if "mass" not in attributes or _numbers(geom, "mass", attributes["mass"], 1)[0] != 0:
        raise TruthError(f'{_label(geom)}: a shape must have mass="0"; masses go into <inertial>')
    if {attributes.get("contype"), attributes.get("conaffinity")} != {"0"}:
        raise TruthError(f'{_label(geom)}: it may touch; set contype="0" and conaffinity="0"')
    if "class" in attributes or "material" in attributes:
        raise TruthError(f"{_label(geom)}: class and material are not handled; give rgba itself")
    ends = "fromto" if "fromto" in attributes else "pos"
    size = 6 if ends == "fromto" else 3
    points = _numbers(geom, ends, attributes.get(ends, "0 0 0"), size).reshape(-1, 3) + origin
    attributes[ends] = " ".join(f"{value:.12g}" for value in points.ravel())
    return Shape(tuple(attributes.items()))


def _read_meshes(root: ET.Element, path: Path) -> tuple[MeshFile, ...]:
    """Read the files of all meshes: the shapes of a campaign must not depend on this folder."""
    folders = [compiler.get("meshdir") for compiler in root.findall("compiler")]
    folder = path.parent / ([name for name in folders if name is not None] or [""])[-1]
    meshes = []
    for asset in root.findall("asset"):
        # A texture is for the eye, and no shape that is carried over names one.
        _check(asset, children={"mesh", "texture"})
        for mesh in asset.findall("mesh"):
            _check(mesh, children=set())
            file = folder / mesh.get("file", "")
            name = mesh.get("name", file.stem)
            if not re.fullmatch(r"\w[\w.-]*", name):
                raise TruthError(f"<mesh> {name!r}: give it a name of letters, digits, _ . -")
            if file.exists() and not file.is_file():  # a pipe or device could be without an end
                raise TruthError(f"<mesh> {name}: {file} is no file; give its file")
            try:
                content = file.read_bytes()
            except OSError as error:
                raise TruthError(
                    f"<mesh> {name}: {file} cannot be read ({error.strerror}); give its file"
                ) from error
            kept = {k: v for k, v in mesh.attrib.items() if k not in ("name", "file")}
            meshes.append(MeshFile(name, file.suffix, content, tuple(kept.items())))
    return tuple(meshes)


def _check_mesh_names(root: ET.Element, meshes: tuple[MeshFile, ...]) -> None:
    known = {mesh.name for mesh in meshes}
    for geom in root.iter("geom"):
        name = geom.get("mesh")
        if name not in known and (name is not None or geom.get("type") == "mesh"):
            raise TruthError(f"{_label(geom)}: there is no mesh {name!r}; name one of <asset>")


def _inertia(inertial: ET.Element, body: ET.Element) -> Real:
    if inertial.get("fullinertia") is not None:
        xx, yy, zz, xy, xz, yz = _vector(inertial, "fullinertia", None, size=6)
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if inertial.get("diaginertia") is None:
        raise TruthError(f"{_label(body)}: its <inertial> has no diaginertia or fullinertia")
    return np.diag(_vector(inertial, "diaginertia", None))


def _check_gravity(root: ET.Element) -> None:
    options = root.findall("option")
    for option in options:
        _check(option, children=set())
    given = [option.get("gravity") for option in options if option.get("gravity") is not None]
    if not given or _numbers(options[-1], "gravity", given[-1], 3).any():
        raise TruthError('<option>: gravity is on; this machine has none, write gravity="0 0 0"')


def _check_angles(root: ET.Element) -> None:
    """Refuse angles in degrees, MJCF's default: the drawing is written in radian."""
    angle = [compiler.get("angle", "degree") for compiler in root.findall("compiler")]
    for geom in root.iter("geom"):
        if geom.attrib.keys() & {"euler", "axisangle"} and angle[-1:] != ["radian"]:
            raise TruthError(f'{_label(geom)}: is turned in degrees; use <compiler angle="radian">')


def _geom_defaults(root: ET.Element) -> dict[str, str]:
    attributes: dict[str, str] = {}
    for default in root.findall("default"):
        for child in default:
            if child.tag not in {"geom", "site"}:
                raise TruthError(f"<default>: it sets <{child.tag}>; write that at each element")
            turned = child.attrib.keys() - {"size", "rgba", "type", "group"}
            if child.tag == "site" and turned:
                raise TruthError(
                    f"<default>: it sets {', '.join(turned)} of every <site>; remove it"
                )
        for geom in default.findall("geom"):
            attributes.update(geom.attrib)
    return attributes


def _check(element: ET.Element, *, children: set[str], owner: ET.Element | None = None) -> None:
    """Refuse every attribute and child that is not known to be honoured or without effect."""
    for attribute in element.attrib:
        if attribute not in _ALLOWED[element.tag]:
            raise TruthError(
                f"{_label(element, owner)}: its {attribute!r} is not handled; remove it"
            )
    for child in element:
        if child.tag not in children | _WITHOUT_EFFECT:
            raise TruthError(f"{_label(child, element)}: is not handled; remove it")


def _label(element: ET.Element, owner: ET.Element | None = None) -> str:
    name = element.get("name")
    label = f"<{element.tag}>" if name is None else f"<{element.tag}> {name}"
    return label if owner is None else f"{label} in {_label(owner)}"


def _name(element: ET.Element) -> str:
    name = element.get("name")
    if not name:
        raise TruthError(f"<{element.tag}>: it has no name; every body and joint needs one")
    return name


def _vector(element: ET.Element, attribute: str, default: str | None, *, size: int = 3) -> Real:
    return _numbers(element, attribute, element.get(attribute, default), size)


def _numbers(element: ET.Element, attribute: str, text: str | None, size: int) -> Real:
    try:
        values = np.array((text or "").split(), dtype=np.float64)
    except ValueError:
        values = np.empty(0)
    if values.shape != (size,) or not np.isfinite(values).all():
        raise TruthError(f"{_label(element)}: {attribute} is {text!r}, expected {size} number(s)")
    return values


def _number(element: ET.Element, attribute: str, default: str | None) -> float:
    return float(_vector(element, attribute, default, size=1)[0])
