"""A machine with a stage or point masses put on it: its MJCF, and the machine read back from it.

Check that a combined MJCF has the elements, masses and springs of the files it is made of.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import ConvergenceError, InputError
from mbmodel.machine import Machine
from mbmodel.machine_loading import load_machine, read_gravity
from mbmodel.mjcf.names import equality_name
from mbmodel.mjcf.read import compile_mjcf
from mbmodel.mjcf.stages import GROUND, tied_stages
from mbmodel.mjcf.written_file import MAX_RELATIVE_DIFFERENCE, Difference, compare_compiled
from mbmodel.mounting.combined_file import CombinedFile
from mbmodel.mounting.place import Offset, PointMass, find_pose

_MAX_UNSEEN_TURN = 1e-6  # of a site's axes against the world [rad]: more needs a remark


@dataclass(frozen=True)
class MountedStage:
    """A stage that a body of a machine carries.

    Args:
        path: MJCF of the stage.
        body: name of the body that carries it.
        place: name of a site of that body, whose axes become those of the stage's world; or offset
            from the body's centre of mass in world axes [m].
    """

    path: Path
    body: str
    place: str | Offset


@dataclass(frozen=True, eq=False)
class Combined:
    """A machine with all that was put on it.

    Args:
        machine: read back from the combined MJCF.
        file: its text, which can be written to any folder.
        remarks: sentences for the user on the combination.
    """

    machine: Machine
    file: CombinedFile
    remarks: tuple[str, ...]


def combine(
    machine: Machine,
    folder: Path,
    stage: MountedStage | None,
    masses: Sequence[PointMass] = (),
    *,
    rates: Mapping[str, float] | None = None,
    key: str | None = None,
) -> Combined:
    """Put a stage and point masses on a machine: write the MJCF, and load the machine from it.

    MuJoCo's own ``<attach>`` mounts the stage, so that its classes, tendons, sensors and assets
    come with it, and each file keeps its own angle units and folders. First the stage is mounted;
    the masses then stand at the bodies' centres of mass as the stage leaves them at rest.

    Args:
        machine: without any addition.
        folder: folder of the files; it exists.
        stage: that the machine carries; None for none.
        masses: on bodies of the machine or of the stage.
        rates: of the hinges that turn steadily [rad/s], by name.
        key: name of the keyframe that the user states; None for the default.

    Raises:
        InputError: a place that the machine does not have, a stage that cannot be read or mounted,
            or settings of a compiler that would change masses.
        ConvergenceError: the combined machine has no static equilibrium.
    """
    for expanded in (False, True):
        combined, difference = _combine(
            machine, folder, stage, masses, rates, key, expanded=expanded
        )
        if difference is None:
            return combined
    raise InputError(
        f"{machine.source} with what is put on it is not the sum of both files: {difference}; "
        "write what differs as <inertial>, stiffness and damping into the files themselves"
    )


def _combine(
    machine: Machine,
    folder: Path,
    stage: MountedStage | None,
    masses: Sequence[PointMass],
    rates: Mapping[str, float] | None,
    key: str | None,
    *,
    expanded: bool,
) -> tuple[Combined, Difference | None]:
    """Return the combined machine, and how its file differs from those that it is made of.

    Args:
        machine: as ``combine`` has it, and the following ones too.
        folder: of the files.
        stage: that the machine carries.
        masses: on bodies.
        key: name of the keyframe.
        expanded: whether the files are written in expanded form.
    """
    base = compile_mjcf(machine.source)
    file = CombinedFile(machine, base, expanded=expanded)
    origins = [(machine.source.name, "", base)]
    remarks: list[str] = []
    loaded = machine
    if stage is not None:
        pose = find_pose(machine, stage.body, stage.place)
        compiled = compile_mjcf(stage.path)
        _refuse_ties_to_world(stage.path, compiled)
        file.mount(stage.path, compiled, pose)
        origins.append((stage.path.name, file.prefix, compiled))
        remarks += _stage_remarks(machine, base, stage, compiled, file)
        loaded = _read(file, machine, folder, rates, key)
    for mass in masses:
        file.add_mass(mass.mass_kg, find_pose(loaded, mass.body, mass.offset_m))
    if masses:
        loaded = _read(file, machine, folder, rates, key)
    path = file.write(folder)
    difference = compare_combination(compile_mjcf(path), origins, [m.mass_kg for m in masses])
    return Combined(loaded, file, tuple(remarks)), difference


def _refuse_ties_to_world(path: Path, model: mujoco.MjModel) -> None:
    """Refuse a stage that an equality constraint ties to its world, which stays behind."""
    for equality, stages in tied_stages(model).items():
        if GROUND in stages:
            raise InputError(
                f"{path}: {equality_name(model, equality)} ties it to its world, which is left out "
                "when it is mounted: tie it to a body of its own"
            )


def _read(
    file: CombinedFile,
    machine: Machine,
    folder: Path,
    rates: Mapping[str, float] | None,
    key: str | None,
) -> Machine:
    """Write and load the combined machine; errors name the machine's file instead of the copy."""
    path = file.write(folder)
    try:
        return load_machine(path, rates, key)
    except (InputError, ConvergenceError) as error:
        message = str(error).replace(str(path), f"{machine.source} with what is put on it")
        raise type(error)(message) from error


def _stage_remarks(
    machine: Machine,
    base: mujoco.MjModel,
    stage: MountedStage,
    compiled: mujoco.MjModel,
    file: CombinedFile,
) -> list[str]:
    """Return what of the stage's file is different on the machine, one sentence each."""
    remarks = []
    if file.prefix:
        remarks.append(
            f"names of {stage.path.name} begin with {file.prefix} on the machine, which has some "
            "of them already"
        )
    turn = _turn(machine, stage)
    if turn > _MAX_UNSEEN_TURN:
        remarks.append(
            f"site {stage.place!r} turns the stage by {np.degrees(turn):.3g} degrees against the "
            "world's axes"
        )
    if file.stage is not None and file.stage.has_geoms:
        remarks.append(
            f"geoms that stand in the world of {stage.path.name} are left out: write as a body "
            "what the machine carries"
        )
    stated, carried = (read_gravity(model) for model in (compiled, base))
    if not np.array_equal(stated, carried):
        texts = [" ".join(f"{value:g}" for value in values) for values in (stated, carried)]
        remarks.append(
            f"gravity is {texts[0]} m/s^2 in {stage.path.name}, but on the machine that of "
            f"{machine.source.name} holds, {texts[1]}"
        )
    return remarks


def _turn(machine: Machine, stage: MountedStage) -> float:
    """Return the angle between a stage's world and the machine's [rad]."""
    if not isinstance(stage.place, str):
        return 0.0
    layout = machine.layout
    axes = layout.axes[layout.points.index(stage.place)]
    return float(Rotation.from_matrix(axes).magnitude())


_COUNTED = {
    "joints": "njnt",
    "tendons": "ntendon",
    "actuators": "nactuator",
    "sensors": "nsensor",
    "equality constraints": "neq",
}  # MuJoCo's counts of what acts on a machine


def compare_combination(
    combined: mujoco.MjModel,
    origins: Sequence[tuple[str, str, mujoco.MjModel]],
    added_masses: Sequence[float],
) -> Difference | None:
    """Return where settings of one file change masses, springs or actuators of another, or None.

    MuJoCo drops what it cannot attach, such as a tendon around a geom that is left out.

    Args:
        combined: compiled.
        origins: for each file its name, the prefix of its names, and the file compiled alone.
        added_masses: point masses [kg].

    Raises:
        InputError: elements that are missing.
    """
    for kind, attribute in _COUNTED.items():
        lost = sum(int(getattr(model, attribute)) for _, _, model in origins)
        lost -= int(getattr(combined, attribute))
        if lost:
            raise InputError(
                f"{origins[-1][0]}: {lost} of its {kind} cannot be mounted, since they use an "
                "element of its world that is left out: draw that element in a body"
            )
    for _, prefix, model in origins:
        if (difference := compare_compiled(model, combined, prefix=prefix)) is not None:
            return difference
    expected = sum(added_masses) + sum(float(model.body_mass[1:].sum()) for _, _, model in origins)
    relative = abs(float(combined.body_mass[1:].sum()) - expected) / expected
    if relative > MAX_RELATIVE_DIFFERENCE:
        return Difference("mass of all bodies", "the combined machine", relative)
    return None
