"""A file written from an MJCF: it is read back and compared before it counts.

The file is written as its author wrote it, with other numbers. Where its settings, classes or
included files would make another machine of it, it is written in expanded form, in which every
element states its own values. A file that differs even then is kept, and named as wrong.

Difference of a written machine from the one that was meant, also by its compiled values.

Nonlinear joints have no linear machine to compare with. What is compared instead is what MuJoCo
compiles: every spring, damper, friction, mass and actuator is that of the source, or as edited.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import mujoco
import numpy as np

from identification.words import ConvergenceError, InputError, Real, WorkbenchError
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf, write_mjcf
from mbmodel.mjcf.names import actuator_name, body_name, joint_name, tendon_name
from mbmodel.mjcf.read import compile_with_remarks

# Of the largest entry of a matrix: two ways to compute it in double precision agree better.
MAX_RELATIVE_DIFFERENCE = 1e-9
_Values = dict[tuple[str, str], Real]  # by name of the element and attribute


@dataclass(frozen=True)
class Difference:
    """Largest difference of a written machine.

    Args:
        what: quantity that differs, such as ``mass``, ``stiffness``, ``point`` or ``motor``; where
            nothing can be compared, the reason.
        place: joint coordinate, body, point or motor at which it is largest.
        relative: difference over the largest entry; infinite where nothing can be compared.
    """

    what: str
    place: str
    relative: float = np.inf

    def __str__(self) -> str:
        """Return it in words."""
        if np.isinf(self.relative):
            return f"{self.place}: {self.what}"
        return f"the {self.what} at {self.place} differs by {100 * self.relative:.2g} %"


def compare_compiled(
    before: mujoco.MjModel,
    after: mujoco.MjModel,
    changes: Sequence[Edit | Addition] = (),
    prefix: str = "",
) -> Difference | None:
    """Return the first value of a written file that is neither the source's nor an edit's, or None.

    Args:
        before: the source, compiled.
        after: the written file, compiled.
        changes: edits of springs, and tendons that were added.
        prefix: of the source's names in the written file.
    """
    expected = _read_values(before)
    for change in changes:
        values = change.values if isinstance(change, Edit) else change.element.values
        for attribute, value in values.items():
            if (change.name, attribute) in expected or isinstance(change, Addition):
                expected[change.name, attribute] = _numbers(value)
    read_values = _read_values(after)
    for (name, attribute), wanted in expected.items():
        if (prefix + name, attribute) not in read_values:
            continue
        read = read_values[prefix + name, attribute][: len(wanted)]
        scale = float(np.abs(wanted).max(initial=0.0)) or 1.0
        relative = float(np.abs(read - wanted).max(initial=0.0)) / scale
        if relative > MAX_RELATIVE_DIFFERENCE:
            return Difference(attribute, name, relative)
    return None


def _numbers(value: str | float | Sequence[float]) -> Real:
    """Return the numbers of an attribute, empty for a text."""
    try:
        return np.atleast_1d(np.array(value, np.float64))
    except ValueError:
        return np.zeros(0)


def _read_values(model: mujoco.MjModel) -> _Values:
    """Return springs, dampers, friction, masses and actuators by name and attribute."""
    values: _Values = {}
    for joint in range(model.njnt):
        name, dof = joint_name(model, joint), model.jnt_dofadr[joint]
        values[name, "stiffness"] = np.append(
            model.jnt_stiffness[joint], model.jnt_stiffnesspoly[joint]
        )
        values[name, "damping"] = np.append(model.dof_damping[dof], model.dof_dampingpoly[dof])
        values[name, "frictionloss"] = model.dof_frictionloss[dof : dof + 1]
        values[name, "armature"] = model.dof_armature[dof : dof + 1]
    for tendon in range(model.ntendon):
        name = tendon_name(model, tendon)
        values[name, "stiffness"] = np.append(
            model.tendon_stiffness[tendon], model.tendon_stiffnesspoly[tendon]
        )
        values[name, "damping"] = np.append(
            model.tendon_damping[tendon], model.tendon_dampingpoly[tendon]
        )
        values[name, "springlength"] = model.tendon_lengthspring[tendon]
    for body in range(1, model.nbody):
        inertia = np.sort(model.body_inertia[body])
        name = body_name(model, body)
        values[name, "mass of the body"] = np.append(model.body_mass[body], inertia)
    for actuator in range(model.nu):
        name = actuator_name(model, actuator)
        values[name, "gain of the actuator"] = model.actuator_gainprm[actuator]
        values[name, "bias of the actuator"] = model.actuator_biasprm[actuator]
    return values


_Comparison = Callable[[Path], Difference | None]
_Changes = Sequence[Edit | Addition]


@dataclass(frozen=True)
class WrittenModel:
    """Outcome of writing a model: what its file lacks, and how it differs.

    Args:
        file: name of the file.
        not_held: what an MJCF cannot hold.
        difference: how the file differs in what it can hold; empty if it does not.
    """

    file: str
    not_held: tuple[NotInMjcf, ...] = ()
    difference: str = ""


NOT_WRITTEN = WrittenModel("")  # a model of which no file was wanted


def refuse_difference(file: str, difference: str) -> None:
    """Raise WorkbenchError if a written file is not the machine in memory.

    Args:
        difference: how it differs; empty if it does not.
    """
    if difference:
        raise WorkbenchError(
            f"{file} is not the machine that was meant: {difference}; all results are kept, but do "
            "not use this file, and report the model"
        )


def write_copy(
    source: Path, target: Path, changes: _Changes = (), folder: Path | None = None
) -> WrittenModel:
    """Write a copy of an MJCF with nonlinear joints, read it back and compare what is compiled.

    Args:
        target: the new file; its folder exists.
        changes: edits of joints and added tendons.
        folder: folder to which the new file will move, which exists; None if it stays.

    Raises:
        InputError: the source cannot be read any more.
    """
    before, _ = compile_with_remarks(source, without_friction=True)
    difference = write_and_compare(source, target, changes, folder, compare_with(before, changes))
    return WrittenModel(target.name, (), "" if difference is None else str(difference))


def compare_with(before: mujoco.MjModel, changes: _Changes) -> _Comparison:
    """Return a comparison of a file with a compiled model that has the changes."""

    def compare(path: Path) -> Difference | None:
        after, _ = compile_with_remarks(path, without_friction=True)
        return compare_compiled(before, after, changes)

    return compare


def write_and_compare(
    source: Path, target: Path, changes: _Changes, folder: Path | None, compare: _Comparison
) -> Difference | None:
    """Write a file as its author wrote it, else in expanded form, until it is what was meant.

    Returns:
        How the file differs even in expanded form; None if it does not.
    """
    difference: Difference | None = None
    for expanded in (False, True):
        if refused := write_mjcf(source, target, changes, folder, expanded=expanded):
            difference = Difference(refused[0].reason, refused[0].name)
            continue
        try:
            with in_place(target, folder) as path:
                difference = compare(path)
        except (InputError, ConvergenceError) as error:
            difference = Difference(f"the file cannot be read ({error})", target.name)
        if difference is None:
            break
    return difference


@contextmanager
def in_place(target: Path, folder: Path | None) -> Iterator[Path]:
    """Yield a written file where it will lie, so that the files that it names are found."""
    if folder is None or folder.resolve() == target.parent.resolve():
        yield target
        return
    copy = folder / f".{uuid4().hex}.xml"
    copy.write_bytes(target.read_bytes())
    try:
        yield copy
    finally:
        copy.unlink()
