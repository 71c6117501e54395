"""A model written as MJCF, read back and compared with the machine in memory.

Comparison of a written MJCF, as it is read back, with the machine in memory.

Both are compared in the joint coordinates that they share. Coordinates that only the file has, such
as those of a mass on a spring, are eliminated at a few s = w (1/2 + i):

    Z_red(s) = Z_ss - Z_sf Z_ff^-1 Z_fs,   Z(s) = s^2 M + s C + K + sum f_i(s) l_i r_i'.

Coordinates that only memory has are directions that it locks by a stiff spring: they are rigid in
the file. Without either, M, C and K themselves are compared. So are the rows of all points and the
columns of all motors.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.words import DIRECTIONS, Complex, Dof, Real
from identification.words.file_access import temporary_folder
from mbmodel.assembly import Assembly
from mbmodel.machine import Machine
from mbmodel.machine_loading import load_machine
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf, write_mjcf
from mbmodel.mjcf.read import compile_with_remarks
from mbmodel.mjcf.written_file import (
    MAX_RELATIVE_DIFFERENCE,
    Difference,
    WrittenModel,
    compare_with,
    in_place,
    write_and_compare,
)
from mbmodel.model import Model, as_drawn
from mbmodel.mujoco_start import mujoco_path
from mbmodel.ports.ports import direction_selection
from mbmodel.writing.additions_at_rest import move_to_rest
from mbmodel.writing.model_edits import held_parameters, model_edits, split_edits


def write_model(
    model: Model, theta: Real, target: Path, folder: Path | None = None
) -> WrittenModel:
    """Write a model at theta into a copy of its MJCF, read it back and compare.

    Laws of nonlinear joints act in tests alone. They are written last, and then every other value
    of the file must stay.

    Args:
        theta: parameters in SI; (n_parameter,).
        target: the new file; its folder exists.
        folder: folder to which the new file will move, which exists; None if it stays.

    Raises:
        InputError: the source cannot be read any more.
    """
    not_held = tuple(edit for edit in model_edits(model, theta) if isinstance(edit, NotInMjcf))
    nominal, held = _following(model), held_parameters(model, theta)
    changes, laws = _edits_at_rest(nominal, theta, held)

    def compare(path: Path) -> Difference | None:
        written = load_machine(path, key=model.machine.keyframe, reading=model.machine.reading)
        return compare_machines(nominal, held, written) or compare_masses(path)

    source = model.machine.source
    difference = write_and_compare(source, target, changes, folder, compare)
    if laws and difference is None:
        with in_place(target, folder) as path:
            linear, _ = compile_with_remarks(path, reading=model.machine.reading)
        difference = write_and_compare(
            source, target, [*changes, *laws], folder, compare_with(linear, laws)
        )
    return WrittenModel(target.name, not_held, "" if difference is None else str(difference))


def read_as_written(model: Model, theta: Real) -> Machine:
    """Return the machine that an MJCF of a model at theta describes, by way of a temporary file.

    The file is in expanded form, so that two machines differ by their parameters alone.

    Args:
        model: machine and Parts; laws that act in tests alone are left out.
        theta: parameters in SI; (n_parameter,).

    Raises:
        InputError: the source cannot be read any more.
    """
    changes, _ = _edits_at_rest(_following(model), theta, held_parameters(model, theta))
    with temporary_folder() as folder:
        write_mjcf(model.machine.source, folder / "machine.xml", changes, expanded=True)
        return load_machine(
            folder / "machine.xml", key=model.machine.keyframe, reading=model.machine.reading
        )


def _edits_at_rest(
    model: Model, theta: Real, held: Real
) -> tuple[list[Edit | Addition], list[Edit | Addition]]:
    """Return edits of the linear machine, and of laws, with additions where the machine rests.

    Args:
        model: which follows its equilibrium.
        theta, held: parameters, and those of them that the file holds; (n_parameter,) each.
    """
    changes, laws = split_edits(model, theta)
    if not any(isinstance(change, Addition) for change in changes):
        return changes, laws
    return move_to_rest(model.machine, model.at_rest(held).machine.pose, changes), laws


def _following(model: Model) -> Model:
    """Return a model whose equilibrium follows its parameters as that of the file does."""
    machine = model.machine
    if machine.statics is not None or machine.spinning:
        return model
    nominal = load_machine(
        machine.source, key=machine.keyframe, follow=True, reading=machine.reading
    )
    return replace(model, machine=replace(machine, statics=nominal.statics))


T = TypeVar("T", bound=np.generic)

# Frequencies at which coordinates are eliminated, over the machine's typical one.
_FREQUENCY_RATIOS = (0.3, 1.0, 3.0)
_OFF_AXIS = 0.5 + 1j  # s over its frequency: no resonance lies there
# Of points and motors of a hung or preloaded machine: both sides search for its rest, to 1e-8 rad.
_MAX_DIFFERENCE_AT_REST = 1e-7
# Of closed chains, where a tuned mass shifts the rest by a little of the sag: all follows the pose.
_MAX_DIFFERENCE_OF_CHAINS = 1e-6
# Masses that MuJoCo and our compilation give: it keeps the vertices of meshes in single precision.
_MAX_MASS_DIFFERENCE = 1e-6


@dataclass(frozen=True, eq=False)
class _Side:
    """The equation of one machine, and the numbers of the shared coordinates in it."""

    assembly: Assembly
    shared: list[int]

    @property
    def machine(self) -> Machine:
        """The machine."""
        return self.assembly.machine

    def has_only_shared(self) -> bool:
        """Return whether there are no further coordinates, and no term that is no polynomial."""
        is_alike = len(self.shared) == len(self.machine.coordinates)
        return is_alike and not self.assembly.frequency_dependent

    def select(self, matrix: NDArray[T]) -> NDArray[T]:
        """Return a matrix of joint coordinates for the shared ones."""
        return matrix[np.ix_(self.shared, self.shared)]

    def dynamic_stiffness(self, laplace: complex) -> Complex:
        """Return Z(s) of all coordinates, with the terms that are no polynomial; (nv, nv)."""
        total: Complex = self.assembly.matrices.dynamic_stiffness(laplace)
        for term in self.assembly.frequency_dependent:
            total = total + term.left @ term.at(np.array([laplace]))[0] @ term.right.T
        return total

    def point_rows(self, point: str) -> Real:
        """Return the motion of a point's six directions per shared coordinate; (6, n)."""
        labels = [Dof(point, f"+{direction}") for direction in DIRECTIONS]
        rows = self.machine.layout.rows(labels)
        for change in self.assembly.point_changes:
            if change.slot == "sensor" and change.point == point:
                added = change.left @ change.core[0] @ change.right.T
                rows = rows + direction_selection(labels, point) @ added
        return (rows @ self.assembly.jacobian)[:, self.shared]

    def motor_columns(self) -> dict[str, Real]:
        """Return the generalised force per control of each motor, by name; (n, 1) each."""
        return {
            name: (gain.joint + self.assembly.jacobian.T @ gain.body)[self.shared, None]
            for name, gain in self.machine.motors.items()
        }


def compare_machines(model: Model, theta: Real, written: Machine) -> Difference | None:
    """Return the largest difference beyond rounding of a written machine, or None.

    Args:
        model: machine and Parts in memory; its control loops and its measured rest do not count.
        theta: parameters that the file holds; (n_parameter,).
        written: machine that the file describes, without corrections of a campaign.
    """
    points = model.machine.layout.points
    if model.machine.correct is not None:  # copies that it adds for hits are not of the file
        corrected = model.machine.correct(written.layout)
        added = set(corrected.points) - set(written.layout.points)
        points = tuple(name for name in points if name not in added)
        written = replace(written, layout=corrected)
    nominal = as_drawn(written)
    names = [model.machine.written_name(name) for name in model.machine.coordinates]
    shared = [name for name in names if name in written.coordinates]
    without_loops = replace(model, machine=replace(model.machine, loops=(), rest=None))
    memory = _Side(without_loops.assemble(theta), [names.index(name) for name in shared])
    file = _Side(
        nominal.assemble(nominal.drawn), [written.coordinates.index(name) for name in shared]
    )
    lacking = [
        *(name for name in _drawn_coordinates(model.machine) if name not in shared),
        *(name for name in points if name not in written.layout.points),
        *(name for name in model.machine.motors if name not in written.motors),
    ]
    if lacking:
        return Difference("the file has no such element", lacking[0])
    differences = [
        *_compare_motion(memory, file, shared),
        *(
            _difference("point", [point] * 6, memory.point_rows(point), file.point_rows(point))
            for point in points
        ),
        *(
            _difference("motor", [name] * len(shared), column, file.motor_columns()[name])
            for name, column in memory.motor_columns().items()
        ),
    ]
    limits = dict.fromkeys((each.what for each in differences), MAX_RELATIVE_DIFFERENCE)
    if memory.machine.pose is not None:
        limits |= {"point": _MAX_DIFFERENCE_AT_REST, "motor": _MAX_DIFFERENCE_AT_REST}
    if memory.machine.tree is not None:
        limits = dict.fromkeys(limits, _MAX_DIFFERENCE_OF_CHAINS)
    excesses = [difference.relative / limits[difference.what] for difference in differences]
    worst = int(np.argmax(excesses))
    return None if excesses[worst] <= 1.0 else differences[worst]


def _drawn_coordinates(machine: Machine) -> tuple[str, ...]:
    """Return the coordinates of the joints of the nominal MJCF."""
    joints = machine.drawing.joints
    return tuple(
        name for name in machine.coordinates if name in joints or name.rpartition(".")[0] in joints
    )


def _compare_motion(memory: _Side, file: _Side, names: list[str]) -> list[Difference]:
    """Return the differences of M, C and K, or of Z(s) where one side has more than these."""
    pairs = zip(_matrices(memory), _matrices(file), strict=True)
    if len(memory.shared) and file.has_only_shared() and not memory.assembly.frequency_dependent:
        whats = "mass", "damping", "stiffness"
        return [
            _difference(what, names, memory.select(first), file.select(second))
            for what, (first, second) in zip(whats, pairs, strict=True)
        ]
    mass, _, stiffness = (np.abs(np.diag(memory.select(matrix))) for matrix in _matrices(memory))
    typical = float(np.sqrt(stiffness.max() / mass.max())) or 1.0
    return [
        _difference(
            "dynamic stiffness",
            names,
            memory.select(memory.dynamic_stiffness(laplace)),
            _reduce(file.dynamic_stiffness(laplace), file.shared),
        )
        for laplace in (ratio * typical * _OFF_AXIS for ratio in _FREQUENCY_RATIOS)
    ]


def _matrices(side: _Side) -> tuple[Real, Real, Real]:
    """Return M, C and K."""
    matrices = side.assembly.matrices
    return matrices.mass, matrices.damping, matrices.stiffness


def _reduce(matrix: Complex, kept: list[int]) -> Complex:
    """Return a dynamic stiffness without the other coordinates, on which no force acts."""
    rest = [k for k in range(len(matrix)) if k not in kept]
    coupled = np.linalg.solve(matrix[np.ix_(rest, rest)], matrix[np.ix_(rest, kept)])
    return matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, rest)] @ coupled


def _difference(
    what: str, names: list[str], first: Real | Complex, second: Real | Complex
) -> Difference:
    """Return the largest difference of two matrices, with the name of its row."""
    if not first.size:
        return Difference(what, "", 0.0)
    scale = max(float(np.abs(first).max()), float(np.abs(second).max())) or 1.0
    row, column = np.unravel_index(np.argmax(np.abs(first - second)), first.shape)
    return Difference(what, names[int(row)], float(np.abs(first - second)[row, column]) / scale)


def compare_masses(path: Path) -> Difference | None:
    """Return where MuJoCo alone gives a body of a file another mass than we read, or None.

    Args:
        path: the written file.

    Raises:
        InputError: the file cannot be read.
    """
    read, _ = compile_with_remarks(path, without_friction=True)
    try:
        alone = mujoco.MjModel.from_xml_path(mujoco_path(path))
    except ValueError as error:
        return Difference(f"MuJoCo refuses it ({' '.join(str(error).split())})", path.name)
    if read.nbody != alone.nbody:
        return Difference("MuJoCo reads another number of bodies", path.name)
    for number in range(1, read.nbody):
        values = [np.append(m.body_inertia[number], m.body_mass[number]) for m in (read, alone)]
        relative = float(np.abs(values[0] - values[1]).max() / (values[0].max() or 1.0))
        if relative > _MAX_MASS_DIFFERENCE:
            return Difference("mass that MuJoCo reads", read.body(number).name, relative)
    return None
