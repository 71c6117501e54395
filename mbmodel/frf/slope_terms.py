"""Terms in the slopes of the equation of motion: real matrices K of low rank, each with its source.

A change of the equation acts as a pseudo-force on the joints, which may be that of a load l on the
bodies, as a motion of the bodies, or on the readout (direct differentiation):

    dH_p = y' g_p + L d_p + c_p,    y = Z^-T T' L' the adjoint solutions of the outputs.

Each term is a sum of s^k f(s) K_p v, with a real matrix K_p of the slope left core_pk right' and a
source v. With x the motion of the joints, b = T x that of the bodies relative to the floor,
a = b + U s^(q-2) their absolute motion, e the inputs' unit forces s^q:

    joint    g = -left core right' x
    body     g = T' l, l = -left core right' b,  of a for masses
    path     d = left core right' x,      g = -T' Zb d + right core' left' (P s^q - Zb b or Mb a)
    hammer   g = T' right core' left' (directions of the inputs) e
    input    g = core / c_p F e,          c = core / c_p L U s^(q-2) for floor motion
    sensor   c = (directions of the outputs) left core right' a
    output   c = (directions of the outputs) left core right' L a

All of it is about H before the factors of the readings. Gravity's stiffness adds -dK x to g where
bodies or joints change.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from identification.words import Complex, Real
from mbmodel.frf.solution import FrfSolution, input_factor, output_selection
from mbmodel.linearisation.gravity import gravity_slope
from mbmodel.parts import Change
from mbmodel.ports.ports import direction_selection

Target = Literal["force", "load", "motion", "readout"]
SourceName = Literal["joints", "relative", "absolute", "body_loads", "inputs", "floor"]
Shape = Callable[[Complex], Complex] | None

INERTIA_POWER = 2  # of s in the inertia forces: masses feel absolute motion, springs relative


@dataclass(frozen=True)
class SlopeSource:
    """SlopeSource v of a term, times a power of s and a function of s.

    Args:
        name: of v.
        power: k of s^k.
        shape: f(s); None for 1.
    """

    name: SourceName
    power: int
    shape: Shape


@dataclass(frozen=True, eq=False)
class SlopeTerm:
    """Matrices K = left core right of the parameters of one Part.

    Args:
        target: what K v is: a pseudo-force, loads on bodies, a motion of bodies, or a reading.
        source: v.
        left: (n, r); None for the unit matrix.
        core: (n_parameter, r, t).
        right: (t, m); None for the unit matrix.
    """

    target: Target
    source: SlopeSource
    left: Real | None
    core: Real
    right: Real | None


def slope_terms(
    solution: FrfSolution, number: int, change: Change, core: Real
) -> Iterator[SlopeTerm]:
    """Yield the terms of one slope.

    Args:
        number: number of the Part.
        change: slope of the Part.
        core: its core for the chosen parameters; (n_parameter, 3, r, t).
    """
    if change.slot == "input":
        yield from _input_terms(solution, number, change, core)
        return
    for power in map(int, np.flatnonzero(core.any(axis=(0, 2, 3)))):
        yield from _terms_of_power(solution, change, core[:, power], power)
    if change.slot in ("body", "path"):
        yield from _gravity_terms(solution, change, core)


def _terms_of_power(
    solution: FrfSolution, change: Change, slope: Real, power: int
) -> Iterator[SlopeTerm]:
    """Yield the terms of one power of s, without those of gravity."""
    shape, left, right = change.shape, change.left, change.right.T
    to_joints, transposed = solution.assembly.jacobian.T, slope.swapaxes(1, 2)
    joints, absolute = SlopeSource("joints", power, shape), SlopeSource("absolute", power, shape)
    outputs, inputs = solution.request.outputs, solution.request.inputs
    if change.slot == "joint":
        yield SlopeTerm("force", joints, -left, slope, right)
    elif change.slot == "body":
        source = absolute if power == INERTIA_POWER else SlopeSource("relative", power, shape)
        yield SlopeTerm("load", source, -left, slope, right)
    elif change.slot == "path":
        yield SlopeTerm("motion", joints, left, slope, right)
        yield from _inertia_terms(solution, left, slope, right, joints)
        loads = SlopeSource("body_loads", power, shape)
        yield SlopeTerm("force", loads, change.right, transposed, left.T)
    elif change.slot == "output":
        selected = output_selection(outputs, change.point) @ left
        relative = (selected @ slope @ right)[:, :, 0]
        rows = np.flatnonzero(relative.any(axis=0))
        one_each, factors = (
            np.eye(len(outputs))[:, rows],
            relative[:, rows, None] * np.eye(len(rows)),
        )
        ports = solution.ports
        yield SlopeTerm("readout", absolute, one_each, factors, ports.readout[rows])
        yield SlopeTerm("readout", joints, one_each, factors, ports.joint_readout[rows])
    elif change.slot == "hammer":
        directions = direction_selection(inputs, change.point) @ left
        unit_forces = SlopeSource("inputs", power, shape)
        yield SlopeTerm("force", unit_forces, to_joints @ change.right, transposed, directions.T)
    else:
        readout = direction_selection(outputs, change.point) @ left
        yield SlopeTerm("readout", absolute, readout, slope, right)


def _input_terms(
    solution: FrfSolution, number: int, change: Change, core: Real
) -> Iterator[SlopeTerm]:
    """Yield the terms of a factor c_p of the inputs: dH = H dc_p / c_p."""
    changes = solution.assembly.input_changes.get(number, ())

    def relative(laplace: Complex) -> Complex:
        """Return f(s) / c_p(s)."""
        numerator = 1.0 if change.shape is None else change.shape(laplace)
        return np.asarray(numerator / input_factor(changes, laplace), np.complex128)

    ports, unit = solution.ports, np.eye(len(solution.request.inputs))
    for power in map(int, np.flatnonzero(core.any(axis=(0, 2, 3)))):
        factors = (change.left @ core[:, power] @ change.right.T) * unit
        inputs = SlopeSource("inputs", power, relative)
        yield SlopeTerm("force", inputs, solution.drive, factors, None)
        if not ports.has_floor:
            continue
        floor = SlopeSource("floor", power, relative)
        yield SlopeTerm("readout", floor, ports.readout @ ports.floor, factors, None)
        for term in solution.assembly.frequency_dependent:
            if not term.is_loop:  # loops that read the floor's motion
                continue
            moved = term.body_right.T @ ports.floor
            product = _shape_product(relative, term.change.shape)
            for order in map(int, np.flatnonzero(term.change.core.any(axis=(1, 2)))):
                source = SlopeSource("floor", power + order, product)
                force = -term.left @ term.change.core[order] @ moved
                yield SlopeTerm("force", source, force, factors, None)


def _inertia_terms(
    solution: FrfSolution, left: Real, slope: Real, right: Real, joints: SlopeSource
) -> Iterator[SlopeTerm]:
    """Yield the pseudo-forces -T' Zb d of joints that move, d = left slope right x."""
    assembly, power, shape = solution.assembly, joints.power, joints.shape
    to_joints = assembly.jacobian.T
    for inertia_power in map(int, np.flatnonzero(assembly.body.any(axis=(1, 2)))):
        source = SlopeSource("joints", power + inertia_power, shape)
        load = -to_joints @ (assembly.body[inertia_power] @ left)
        yield SlopeTerm("force", source, load, slope, right)
    for term in assembly.frequency_dependent:
        if not term.body_right.any():
            continue
        core = term.change.core
        for rows, columns, factor in _split_shape(term.change.shape, core.shape[1:]):
            product = _shape_product(shape, factor)
            moved = term.body_right[:, columns].T @ left
            for inertia_power in map(int, np.flatnonzero(core.any(axis=(1, 2)))):
                source = SlopeSource("joints", power + inertia_power, product)
                load = -term.left[:, rows] @ core[inertia_power, rows, columns] @ moved
                yield SlopeTerm("force", source, load, slope, right)


def _gravity_terms(solution: FrfSolution, change: Change, core: Real) -> Iterator[SlopeTerm]:
    """Yield the pseudo-forces -dK x of gravity."""
    assembly = solution.assembly
    machine = assembly.machine
    power = INERTIA_POWER if change.slot == "body" else 0
    if not assembly.has_weight or not core[:, power].any():
        return
    slopes = np.zeros((len(core), *assembly.matrices.mass.shape))
    for slope, core_slope in zip(slopes, core[:, power], strict=True):
        body_slope = change.left @ core_slope @ change.right.T
        varied = {"jacobian_change": body_slope}
        if change.slot == "body":
            varied = {"inertia_change": machine.weight_fraction[:, None] * body_slope}
        slope[:] = gravity_slope(
            machine.weight,
            assembly.jacobian,
            assembly.weight_bearing_mass,
            **varied,
        )
    yield SlopeTerm("force", SlopeSource("joints", 0, change.shape), None, -slopes, None)


def _shape_product(first: Shape, second: Shape) -> Shape:
    """Return the product of two shapes, each of which may be None."""
    if first is None or second is None:
        return second if first is None else first
    return lambda laplace: first(laplace) * second(laplace)


def act_on_joints(load: SlopeTerm, to_joints: Real) -> SlopeTerm:
    """Return the pseudo-force of a load on bodies.

    Args:
        load: term with the target ``load``.
        to_joints: T'; (nv, 6 n_body).
    """
    at_joints = to_joints if load.left is None else to_joints @ load.left
    return SlopeTerm("force", load.source, at_joints, load.core, load.right)


def _split_shape(shape: Shape, size: tuple[int, int]) -> Iterator[tuple[slice, slice, Shape]]:
    """Yield rows and columns of a core with one factor f(s) each.

    Args:
        shape: f(s) of the whole core, or of each of its entries.
        size: rows and columns of the core.
    """
    if shape is None or shape(np.ones(1, complex)).ndim == 1:
        yield slice(None), slice(None), shape
        return
    for row, column in np.ndindex(size):
        entry = partial(_read_entry, shape, row, column)
        yield slice(row, row + 1), slice(column, column + 1), entry


def _read_entry(
    shape: Callable[[Complex], Complex], row: int, column: int, laplace: Complex
) -> Complex:
    """Return the factor f(s) of one entry of a core; (n_freq,)."""
    return shape(laplace)[:, row, column]
