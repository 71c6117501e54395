"""Read any MJCF through MuJoCo itself: geometry, masses, springs and remaining forces at rest.

A station of such a file keeps the compiled model. ``settle`` gives that model the station's own
values, and returns the station at the equilibrium that the machine then has.

The files that an MJCF reads, so that a campaign can hold copies of all of them.

Read a machine: one that its own values describe in full, else any MJCF through MuJoCo.
"""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from truth.errors import TruthError
from truth.machine import mjcf_reader
from truth.machine.couplings import gravity_stiffness
from truth.machine.dynamics import assemble, joint_rows
from truth.machine.mujoco_elements import (
    coordinates,
    instruments,
    joints_of,
    leads,
    motors_of,
    rigid_body,
    tendons_of,
    welded_to,
)
from truth.machine.mujoco_forces import balance, force_slopes, full_mass
from truth.machine.springs import GROUND, Remaining
from truth.machine.station import StageBody, Station

_HOME = "home"  # the keyframe at which the search for the equilibrium begins, if there is one
_MIN_REMAINDER = 1e-11  # of the matrices' diagonals, below which a remainder is none
# Sensors of joints, with the time derivatives that they read.
_JOINT_SENSORS = {
    int(mujoco.mjtSensor.mjSENS_JOINTPOS): 0,
    int(mujoco.mjtSensor.mjSENS_JOINTVEL): 1,
}

# Flags of MJCF by what they switch off, with MuJoCo's bits.
SWITCHES = {
    "contact": ("contact", mujoco.mjtDisableBit.mjDSBL_CONTACT),
    "friction": ("frictionloss", mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS),
    "limits": ("limit", mujoco.mjtDisableBit.mjDSBL_LIMIT),
    "gravity": ("gravity", mujoco.mjtDisableBit.mjDSBL_GRAVITY),
}


@dataclass(frozen=True, eq=False)
class CompiledModel:
    """A machine as MuJoCo compiled it, at rest.

    Args:
        model: with the values of its station.
        data: at rest.
        files: content of the files that it was read from, by their paths within one folder.
        entry: path of the main file among them.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    files: Mapping[str, bytes]
    entry: str

    def find_sensed_joint(self, sensor: str) -> tuple[str, int]:
        """Return the joint that a sensor reads, empty if none, and its time derivatives."""
        number = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SENSOR, sensor)
        order = _JOINT_SENSORS.get(int(self.model.sensor_type[number])) if number >= 0 else None
        if order is None:
            return "", 0
        return str(self.model.joint(self.model.sensor_objid[number]).name), order


def read_machine(path: Path, without: Iterable[str] = ()) -> Station:
    """Read a nominal machine, as it is at its static equilibrium.

    Args:
        path, without: as for ``read_station``; copies of the files switch off the same.

    Raises:
        TruthError: MuJoCo refuses the file, or the machine has no stable equilibrium.
    """
    files, entry = gather_files(path)
    try:
        model = mujoco.MjModel.from_xml_path(os.fsencode(path))
    except (ValueError, mujoco.FatalError) as error:
        message = " ".join(str(error).split())
        raise TruthError(f"{path}: MuJoCo refuses it: {message}") from error
    if not model.nv:
        raise TruthError(f"{path}: no body has a joint; give at least one body a joint")
    flags = [SWITCHES[kind] for kind in without]
    model.opt.disableflags |= sum(int(bit) for _, bit in flags)
    files = switch_off(files, entry, [name for name, _ in flags])
    _refuse_unlinear(path, model)
    data = mujoco.MjData(model)
    names = [model.key(number).name for number in range(model.nkey)]
    if _HOME in names:
        mujoco.mj_resetDataKeyframe(model, data, names.index(_HOME))
        data.qvel[:] = 0.0
    try:
        balance(model, data)
    except TruthError as error:
        raise TruthError(f"{path}: {error}") from error
    if data.nefc:
        raise TruthError(f"{path}: a contact or limit acts at rest; switch it off")
    return station_of(CompiledModel(model, data, files, entry), path.stem)


def _refuse_unlinear(path: Path, model: mujoco.MjModel) -> None:
    """Refuse what has no linear model."""
    off = model.opt.disableflags
    if model.eq_active0.any() and not off & mujoco.mjtDisableBit.mjDSBL_EQUALITY:
        raise TruthError(f"{path}: an equality constraint closes a loop; remove it")
    has_friction = (model.dof_frictionloss > 0).any() or (model.tendon_frictionloss > 0).any()
    if has_friction and not off & mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS:
        raise TruthError(f"{path}: frictionloss has no linear model; remove it")
    if model.na or (model.actuator_delay > 0).any():
        raise TruthError(f"{path}: an actuator has a state or a delay; remove it")


def station_of(source: CompiledModel, name: str) -> Station:
    """Return the station of a machine at rest."""
    model, data = source.model, source.data
    welded, order, stages = welded_to(model), leads(model), []
    for lead in order:
        members = np.flatnonzero(welded == lead)
        mass, centre, inertia = rigid_body(model, data, members)
        above = int(welded[model.body_parentid[lead]])
        sensors, hits = instruments(model, data, lead)
        stages.append(
            StageBody(
                name=model.body(lead).name or f"body{lead}",
                parent=order.index(above) if above else GROUND,
                mass=mass,
                com=centre,
                inertia=inertia,
                joints=joints_of(model, data, lead),
                sensors=sensors,
                hit_points=hits,
            )
        )
    off = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    stated = model.names.split(b"\0", 1)[0].decode()
    station = Station(
        name=name if stated in ("", "MuJoCo Model") else stated,
        stages=tuple(stages),
        gravity=np.zeros(3) if off else model.opt.gravity.copy(),
        tendons=tendons_of(model, data),
        motors=motors_of(model, data),
        source=source,
    )
    return replace(station, remaining=_remaining(station, model, data))


def _remaining(station: Station, model: mujoco.MjModel, data: mujoco.MjData) -> Remaining | None:
    """Return what MuJoCo's own mass and forces have beside bodies, springs, tendons and weights."""
    names = coordinates(model)
    order = [joint.name for stage in station.stages for joint in stage.joints]
    place = np.array([order.index(name) for name in names])
    totals = [
        full_mass(model, data),
        force_slopes(model, data, "velocity"),
        force_slopes(model, data, "position"),
    ]
    known = [np.zeros_like(totals[0]) for _ in totals]
    equations = assemble(station)
    moving = [joint_rows(station, index)[0] for index in range(len(station.stages))]
    motion = np.linalg.inv(np.vstack([*moving, equations.rigid]))[:, : len(names)]
    known[0] += (motion.T @ equations.mass @ motion)[np.ix_(place, place)]
    joints = {joint.name: joint for stage in station.stages for joint in stage.joints}
    known[1] += np.diag([joints[name].damping for name in names])
    known[2] += np.diag([joints[name].stiffness for name in names])
    known[2] += gravity_stiffness(station)[np.ix_(place, place)]
    for tendon in station.tendons:
        row = tendon.row(names)
        known[1] += tendon.damping * np.outer(row, row)
        known[2] += tendon.stiffness * np.outer(row, row)
    rest = []
    for total, part in zip(totals, known, strict=True):
        matrix = total - part
        size = np.sqrt(np.outer(np.abs(np.diag(total)), np.abs(np.diag(total))))
        matrix[np.abs(matrix) <= _MIN_REMAINDER * np.maximum(size, np.abs(part))] = 0.0
        rest.append((matrix + matrix.T) / 2)
    if not any(matrix.any() for matrix in rest):
        return None
    return Remaining(tuple(names), *rest)


_COMPILER_FOLDERS = ("", "meshdir", "texturedir", "assetdir")


def gather_files(path: Path) -> tuple[Mapping[str, bytes], str]:
    """Return the content of an MJCF and of all files that it reads.

    Returns:
        Content by path within their common folder, and the main file's path there.

    Raises:
        TruthError: a file cannot be read.
    """
    main = path.absolute()
    files: dict[Path, bytes] = {}
    waiting = [main]
    while waiting:
        file = Path(os.path.normpath(waiting.pop()))
        if file in files:
            continue
        files[file] = _content(file)
        if file.suffix.lower() in (".xml", ".mjcf") or file == main:
            waiting += _list_named_files(file, files[file], main.parent)
    common = Path(os.path.commonpath([file.parent for file in files]))
    contents = {file.relative_to(common).as_posix(): content for file, content in files.items()}
    return contents, Path(os.path.normpath(main)).relative_to(common).as_posix()


def switch_off(files: Mapping[str, bytes], entry: str, flags: Iterable[str]) -> Mapping[str, bytes]:
    """Return the files of an MJCF, whose main one sets flags of MuJoCo to ``disable``.

    Args:
        files, entry: as ``gather_files`` returns them.
        flags: attributes of ``<flag>``; without any, the files are returned as they are.
    """
    values = dict.fromkeys(flags, "disable")
    if not values:
        return files
    root = ET.fromstring(files[entry])
    ET.SubElement(ET.SubElement(root, "option"), "flag", values)  # the last one counts
    return {**files, entry: ET.tostring(root)}


def _content(file: Path) -> bytes:
    if file.exists() and not file.is_file():  # a pipe or device could be without an end
        raise TruthError(f"{file}: is no file; give an MJCF file")
    try:
        return file.read_bytes()
    except OSError as error:
        raise TruthError(f"{file}: cannot be read ({error.strerror}); give its file") from error


def _list_named_files(file: Path, content: bytes, folder: Path) -> list[Path]:
    """Return the files that a text names, in any of the folders that it states."""
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        raise TruthError(f"{file}: is not XML ({error}); give an MJCF file") from error
    folders = {folder, file.parent}
    for compiler in root.iter("compiler"):
        folders |= {folder / compiler.get(name, "") for name in _COMPILER_FOLDERS}
    names = {
        value
        for element in root.iter()
        for key, value in element.attrib.items()
        if key.startswith("file")
    }
    places = [place / name for name in names for place in folders]
    return [place for place in places if place.is_file()]


def read_station(path: Path, without: Iterable[str] = ()) -> Station:
    """Read a nominal machine.

    Bodies with springs along joints, without weight, tendons or actuators, become a station that
    can be written again with other masses and joints. Any other MJCF is read through MuJoCo: it
    keeps its compiled model, and campaigns hold copies of its files.

    Args:
        path: an MJCF.
        without: what is switched off: ``contact``, ``friction``, ``limits``, ``gravity``.

    Raises:
        TruthError: the file cannot be read, or has no linear model.
    """
    try:
        return mjcf_reader.read_station(path)
    except TruthError:
        return read_machine(path, without)


def why_as_drawn(path: Path) -> str:
    """Return why a machine is tested as it is drawn; empty if drawings of its own can be drawn."""
    try:
        mjcf_reader.read_station(path)
    except TruthError as reason:
        return str(reason).removesuffix("; remove it")
    return ""
