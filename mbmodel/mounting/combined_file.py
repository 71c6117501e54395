"""MJCF of a machine with a stage attached to a body, and point masses on bodies.

Copy of a stage's MJCF that can be attached to a body of another machine.

Keyframes of a machine with a stage on it: poses and controls of both.
"""

from dataclasses import dataclass
from pathlib import Path
from xml.dom import minidom

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import InputError, Real
from mbmodel.additions import point_mass_element
from mbmodel.machine import Machine
from mbmodel.mjcf.asset_paths import redirect_paths
from mbmodel.mjcf.edit import Element, Values, make_element
from mbmodel.mjcf.expand import expand_mjcf, flatten_mjcf, root_element
from mbmodel.mjcf.keyframes import HOME, joint_number_behind
from mbmodel.mounting.name_clashes import choose_prefix, find_names, free_name
from mbmodel.mounting.place import BodyPose

COMBINED_NAME = "combined.xml"  # the machine with all that is put on it
STAGE_COPY_NAME = "combined_stage.xml"  # the stage, which the combined file attaches


class CombinedFile:
    """Text of a machine's MJCF that grows by a stage and by masses.

    Args:
        machine: without any addition.
        compiled: the machine's MJCF compiled.
        expanded: whether both files are written in expanded form, so that settings and classes of
            one cannot change the other.

    Attributes:
        prefix: of the stage's names; empty if they are as in its own file.
        stage: the stage's MJCF; None without a stage.
    """

    def __init__(
        self, machine: Machine, compiled: mujoco.MjModel, *, expanded: bool = False
    ) -> None:
        self._source, self._compiled, self._expanded = machine.source, compiled, expanded
        self._document = (expand_mjcf if expanded else flatten_mjcf)(machine.source)
        self._names = find_names(compiled, self._document)
        self._stage_source: Path | None = None
        self._attached = ""
        self.stage: StageCopy | None = None
        self.prefix = ""
        _turn_off_fusing(self._document)
        root_element(self._document).setAttribute("model", machine.name)

    def mount(self, source: Path, compiled: mujoco.MjModel, pose: BodyPose) -> None:
        """Attach a stage to a body.

        Args:
            source: MJCF of the stage.
            compiled: that MJCF compiled.
            pose: of the stage's world in the body.

        Raises:
            InputError: the machine's file has no element for the body.
        """
        self.stage = copy_stage(source, expanded=self._expanded)
        self._stage_source = source
        _turn_off_fusing(self.stage.document)
        names = find_names(compiled, self.stage.document)
        title = root_element(self.stage.document).getAttribute("model") or source.stem
        self.prefix = choose_prefix(self._names, names, title)
        self._attached = free_name(self._names, "mounted")
        self._extend_title(title)
        turn = Rotation.from_matrix(pose.axes).as_quat()[[3, 0, 1, 2]]
        attach = Element("attach", {"model": self._attached, "prefix": self.prefix})
        values: Values = {"pos": tuple(pose.position.tolist()), "quat": tuple(turn.tolist())}
        frame = make_element(self._document, Element("frame", values, (attach,)))
        self._body(pose.body).appendChild(frame)
        self._names |= {(kind, self.prefix + name) for kind, name in names}
        root = root_element(self._document)
        for section in tuple(self._document.getElementsByTagName("keyframe")):
            root.removeChild(section)
        if keys := join_keyframes(self._compiled, compiled, pose.body):
            root.appendChild(make_element(self._document, Element("keyframe", {}, keys)))

    def add_mass(self, mass_kg: float, pose: BodyPose) -> None:
        """Weld a point mass to a body of the machine or of the stage.

        Args:
            mass_kg: [kg].
            pose: of the mass in the body.

        Raises:
            InputError: no file has an element for the body.
        """
        parent = self._body(pose.body)
        name = free_name(self._names, "added_mass")
        self._names |= {("port", name), ("port", self.prefix + name)}
        body = point_mass_element(name, pose.position, mass_kg, 1.0 - pose.weight_fraction)
        parent.appendChild(make_element(self._document, body))
        self._extend_title(f"{mass_kg:g} kg on {pose.body}")

    def write(self, folder: Path, home: Path | None = None) -> Path:
        """Write the files, and return the path of the combined one.

        Args:
            folder: exists.
            home: folder to which the files will move; None if they stay.
        """
        home = (home or folder).resolve()
        document = _copy(self._document, self._source, home)
        if self.stage is not None and self._stage_source is not None:
            model = Element("model", {"name": self._attached, "file": STAGE_COPY_NAME})
            asset = make_element(document, Element("asset", {}, (model,)))
            root_element(document).appendChild(asset)
            stage = _copy(self.stage.document, self._stage_source, home)
            (folder / STAGE_COPY_NAME).write_text(stage.toxml() + "\n", encoding="utf-8")
        path = folder / COMBINED_NAME
        path.write_text(document.toxml() + "\n", encoding="utf-8")
        return path

    def _extend_title(self, addition: str) -> None:
        root = root_element(self._document)
        title = root.getAttribute("model")
        root.setAttribute("model", f"{title} {'and' if ' with ' in title else 'with'} {addition}")

    def _body(self, name: str) -> minidom.Element:
        """Return the element of a body, in the machine's file or in the stage's."""
        documents = [(self._document, name)]
        if self.stage is not None and name.startswith(self.prefix):
            documents.append((self.stage.document, name.removeprefix(self.prefix)))
        for document, written in documents:
            for world in document.getElementsByTagName("worldbody"):
                for body in world.getElementsByTagName("body"):
                    if body.getAttribute("name") == written:
                        return body
        raise InputError(
            f"{self._source} has no <body> element named {name!r}: write the body out, with a "
            "name, where it is attached, replicated or unnamed"
        )


def _copy(document: minidom.Document, source: Path, home: Path) -> minidom.Document:
    """Return a copy of an MJCF whose files are found from another folder."""
    copy = document.cloneNode(True)
    if copy is None:
        raise ValueError("an XML document without content cannot be copied")
    if source.resolve().parent != home:
        redirect_paths(copy, source, home)
    return copy


def _turn_off_fusing(document: minidom.Document) -> None:
    """Keep welded bodies apart, so that their masses can be compared with those of their files."""
    for compiler in document.getElementsByTagName("compiler"):
        if compiler.hasAttribute("fusestatic"):
            compiler.removeAttribute("fusestatic")


# Sections in which the machine's own settings count; keyframes are those of both together.
_MACHINE_SECTIONS = ("option", "visual", "statistic", "size", "keyframe")
# What stands still in the stage's world and belongs to its surroundings.
_SURROUNDINGS = ("geom", "light")
# Elements of the world that group others.
_GROUPING_TAGS = ("frame", "replicate")


@dataclass(frozen=True, eq=False)
class StageCopy:
    """A stage without its surroundings.

    Args:
        document: the copy.
        has_geoms: whether the world of the stage has geoms; the copy has none of them.
    """

    document: minidom.Document
    has_geoms: bool


def copy_stage(source: Path, *, expanded: bool = False) -> StageCopy:
    """Return what of a stage's MJCF is mounted: its bodies, and the sites of its world.

    The world of the stage becomes the body that carries it. Springs may begin at sites of that
    world, so these stay. Its geoms would give the carrying body mass, and are left out.

    Args:
        source: MJCF of the stage.
        expanded: whether to copy its expanded form.

    Raises:
        InputError: the file is no MJCF, or has no body.
    """
    document = (expand_mjcf if expanded else flatten_mjcf)(source)
    root = root_element(document)
    if root.tagName != "mujoco":
        raise InputError(f"{source} is no MJCF: its first element must be <mujoco>")
    if not document.getElementsByTagName("body"):
        raise InputError(f"{source} has no body to mount: write the stage as bodies")
    for child in tuple(root.childNodes):
        if isinstance(child, minidom.Element) and child.tagName in _MACHINE_SECTIONS:
            root.removeChild(child)
    worlds = document.getElementsByTagName("worldbody")
    removed = [tag for world in worlds for tag in _remove_surroundings(world)]
    return StageCopy(document, "geom" in removed)


def _remove_surroundings(parent: minidom.Element) -> list[str]:
    """Remove geoms and lights that stand in the world itself; return their tags."""
    removed = []
    for child in tuple(parent.childNodes):
        if not isinstance(child, minidom.Element):
            continue
        if child.tagName in _SURROUNDINGS:
            parent.removeChild(child)
            removed.append(child.tagName)
        elif child.tagName in _GROUPING_TAGS:
            removed += _remove_surroundings(child)
    return removed


def join_keyframes(
    machine: mujoco.MjModel, stage: mujoco.MjModel, body: str
) -> tuple[Element, ...]:
    """Return the machine's keyframes with the pose of the stage in each.

    The stage stands in its own ``home``, or as drawn without one. If only the stage has a ``home``,
    the machine's drawing with it is ``home``. MuJoCo orders positions by body, depth first: those
    of the stage stand behind those of all bodies that its body carries. Controls of the stage stand
    last.

    Args:
        machine: compiled.
        stage: compiled.
        body: name of the body that carries the stage.
    """
    pose, control = _key(stage, HOME)
    place = np.append(machine.jnt_qposadr, machine.nq)[joint_number_behind(machine, body)]
    names = [machine.key(number).name for number in range(machine.nkey)]
    numbers: list[int | None] = list(range(machine.nkey))
    if HOME not in names and _has_key(stage, HOME):
        names, numbers = [*names, HOME], [*numbers, None]
    elements = []
    for name, number in zip(names, numbers, strict=True):
        positions = machine.qpos0 if number is None else machine.key_qpos[number]
        drive = np.zeros(machine.nu) if number is None else machine.key_ctrl[number]
        values: dict[str, str | float | tuple[float, ...]] = {
            "qpos": tuple(np.insert(positions, place, pose).tolist())
        }
        if machine.nu + stage.nu:
            values["ctrl"] = tuple(np.append(drive, control).tolist())
        if number is not None and machine.nmocap:
            values["mpos"] = tuple(machine.key_mpos[number].tolist())
            values["mquat"] = tuple(machine.key_mquat[number].tolist())
        named: Values = {"name": name, **values} if name else values
        elements.append(Element("key", named))
    return tuple(elements)


def _has_key(model: mujoco.MjModel, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, name) >= 0)


def _key(model: mujoco.MjModel, name: str) -> tuple[Real, Real]:
    """Return positions and controls of a keyframe; of the drawing if there is none of the name."""
    if not _has_key(model, name):
        return model.qpos0, np.zeros(model.nu)
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, name)
    return model.key_qpos[number], model.key_ctrl[number]
