"""Comparison of a written MJCF, as it is read back, with the machine in memory.

Both are compared in the joint coordinates of the machine in memory. Coordinates that only the file
has, such as those of a mass on a spring, are eliminated at a few s = w (1/2 + i):

    Z_red(s) = Z_mm - Z_mf Z_ff^-1 Z_fm,   Z(s) = s^2 M + s C + K + sum f_i(s) l_i r_i'.

Coordinates that only memory has are directions that it holds by a stiff spring: they are rigid in
the file. Without either, M, C and K themselves are compared. So are the rows of all points and the
columns of all motors.
"""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from identification.words import DIRECTIONS, Dof, Real
from mbmodel.assembly import Assembly
from mbmodel.frf.ports import direction_selection
from mbmodel.machine import Machine
from mbmodel.mjcf.read import compile_with_remarks
from mbmodel.model import Model, as_drawn
from mbmodel.mujoco_start import mujoco_path
from mbmodel.writing.difference import MAX_RELATIVE_DIFFERENCE, Difference

# Frequencies at which coordinates are eliminated, over the machine's typical one.
_FREQUENCY_RATIOS = (0.3, 1.0, 3.0)
_OFF_AXIS = 0.5 + 1j  # s over its frequency: no resonance lies there
# Masses that MuJoCo and our compilation give: it keeps the vertices of meshes in single precision.
_MAX_MASS_DIFFERENCE = 1e-6


def compare_machines(model: Model, theta: Real, written: Machine) -> Difference | None:
    """Return the largest difference beyond rounding of a written machine, or None.

    Args:
        model: machine and Parts in memory; its control loops do not count.
        theta: parameters that the file holds; (n_parameter,).
        written: machine that the file describes.
    """
    memory = replace(model, machine=replace(model.machine, loops=()))
    assembly = memory.assemble(theta)
    drawn = as_drawn(written)
    read = drawn.assemble(drawn.drawn)
    names = [model.machine.written_name(name) for name in model.machine.coordinates]
    shared = [name for name in names if name in written.coordinates]
    ours = [names.index(name) for name in shared]
    theirs = [written.coordinates.index(name) for name in shared]
    if missing := [name for name in _drawn_coordinates(model.machine) if name not in shared]:
        return Difference("coordinate", missing[0], 1.0)
    found = [
        *_compare_motion(assembly, read, ours, theirs, shared),
        *_compare_points(assembly, read, ours, theirs),
        *_compare_motors(assembly, read, ours, theirs),
    ]
    worst = max(found, key=lambda difference: difference.relative, default=None)
    return None if worst is None or worst.relative <= MAX_RELATIVE_DIFFERENCE else worst


def _drawn_coordinates(machine: Machine) -> tuple[str, ...]:
    """Return the coordinates of the joints of the nominal MJCF."""
    return tuple(
        name
        for name in machine.coordinates
        if name in machine.drawing.joints or name.rpartition(".")[0] in machine.drawing.joints
    )


def _compare_motion(
    memory: Assembly, read: Assembly, ours: list[int], theirs: list[int], names: list[str]
) -> list[Difference]:
    """Return the differences of M, C and K, or of Z(s) where one side has further coordinates."""
    alike = len(theirs) == len(read.machine.coordinates)
    if alike and not memory.frequency_dependent:
        return [
            _difference(what, names, first[np.ix_(ours, ours)], second[np.ix_(theirs, theirs)])
            for what, first, second in (
                ("mass", memory.matrices.mass, read.matrices.mass),
                ("damping", memory.matrices.damping, read.matrices.damping),
                ("stiffness", memory.matrices.stiffness, read.matrices.stiffness),
            )
        ]
    mass, stiffness = (
        matrix[np.ix_(ours, ours)] for matrix in (memory.matrices.mass, memory.matrices.stiffness)
    )
    typical = np.sqrt(np.abs(np.diag(stiffness)).max() / np.abs(np.diag(mass)).max()) or 1.0
    differences = []
    for ratio in _FREQUENCY_RATIOS:
        laplace = ratio * typical * _OFF_AXIS
        first = _dynamic_stiffness(memory, laplace)[np.ix_(ours, ours)]
        second = _reduce(_dynamic_stiffness(read, laplace), theirs)
        differences.append(_difference("dynamic stiffness", names, first, second))
    return differences


def _dynamic_stiffness(assembly: Assembly, laplace: complex) -> np.ndarray[tuple[int, int]]:
    """Return Z(s) with the terms that are no polynomial in s; (nv, nv)."""
    total = assembly.matrices.dynamic_stiffness(laplace)
    for term in assembly.frequency_dependent:
        total = total + term.left @ term.at(np.array([laplace]))[0] @ term.right.T
    return total


def _reduce(matrix: np.ndarray, kept: list[int]) -> np.ndarray:
    """Return a dynamic stiffness without the other coordinates, on which no force acts."""
    rest = [k for k in range(len(matrix)) if k not in kept]
    if not rest:
        return matrix[np.ix_(kept, kept)]
    coupled = np.linalg.solve(matrix[np.ix_(rest, rest)], matrix[np.ix_(rest, kept)])
    reduced: np.ndarray = matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, rest)] @ coupled
    return reduced


def _compare_points(
    memory: Assembly, read: Assembly, ours: list[int], theirs: list[int]
) -> list[Difference]:
    """Return the differences of the motion of all points per joint coordinate."""
    layouts = memory.machine.layout, read.machine.layout
    differences = []
    for point in layouts[0].points:
        if point not in layouts[1].points:
            differences.append(Difference("point", point, 1.0))
            continue
        labels = [Dof(point, f"+{direction}") for direction in DIRECTIONS]
        first = layouts[0].rows(labels)
        for change in memory.point_changes:
            if change.slot == "sensor" and change.point == point:
                first = first + direction_selection(labels, point) @ (
                    change.left @ change.core[0] @ change.right.T
                )
        rows = (first @ memory.jacobian)[:, ours], (layouts[1].rows(labels) @ read.jacobian)
        differences.append(_difference("point", [point] * 6, rows[0], rows[1][:, theirs]))
    return differences


def _compare_motors(
    memory: Assembly, read: Assembly, ours: list[int], theirs: list[int]
) -> list[Difference]:
    """Return the differences of the generalised forces of all motors."""
    differences = []
    for name, gain in memory.machine.motors.items():
        if (other := read.machine.motors.get(name)) is None:
            differences.append(Difference("motor", name, 1.0))
            continue
        first = gain.joint + memory.jacobian.T @ gain.body
        second = other.joint + read.jacobian.T @ other.body
        differences.append(
            _difference("motor", [name] * len(ours), first[ours, None], second[theirs, None])
        )
    return differences


def _difference(what: str, names: list[str], first: np.ndarray, second: np.ndarray) -> Difference:
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
    ours, _ = compile_with_remarks(path, without_friction=True)
    try:
        theirs = mujoco.MjModel.from_xml_path(mujoco_path(path))
    except ValueError as error:
        return Difference(f"file ({' '.join(str(error).split())})", path.name, 1.0)
    if ours.nbody != theirs.nbody:
        return Difference("number of bodies", path.name, 1.0)
    for number in range(1, ours.nbody):
        values = [np.append(m.body_inertia[number], m.body_mass[number]) for m in (ours, theirs)]
        relative = float(np.abs(values[0] - values[1]).max() / (values[0].max() or 1.0))
        if relative > _MAX_MASS_DIFFERENCE:
            return Difference("mass that MuJoCo reads", ours.body(number).name, relative)
    return None
