"""Exact gradients of H(s) = s^q [L T Z^-1 F + L U / s^2], F = T' B + motors, B = P - Mb U.

With x = s^q Z^-1 F and b = T x + U s^(q - 2), the motion of the bodies, a small change gives

    dH = dL b + L dT x                                         sensors, kinematics
       - y' dZj x - y' T' (dZb T x + dMb U s^q)                joints, bodies
       - y' (dT' Zb T + T' Zb dT) x + s^q y' (dT' B + T' dP)   kinematics again, hammer
       + H dc                                                  outputs, c the log of their factor

with y = Z^-T T' L' and dZb = s^2 dMb + ...; gravity adds the changes of its stiffness with T and
Mb. A scalar cost with cotangent W, dJ = Re sum conj(W) dH, needs one more solve,
a = Z^-T G' conj(W), whatever the number of parameters (the adjoint method). Every slot then has one
real cotangent S with dJ = sum <S, change>, summed over lines and inputs once for all parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from identification.words import Complex, Real
from mbmodel.frf.forward_sensitivities import ForwardSensitivities, Slopes
from mbmodel.frf.solution import FrfSolution, output_selection
from mbmodel.linearisation.gravity import gravity_adjoint
from mbmodel.parts import Change, Slot
from mbmodel.ports.ports import direction_selection


def gradient(solution: FrfSolution, slopes: Slopes, cotangent: Complex) -> Real:
    """Return the derivative of a scalar cost by every parameter.

    Args:
        cotangent: W with dJ = Re sum conj(W) dH; (n_freq, n_out, n_in).

    Returns:
        dJ / dtheta in SI; (n_parameter,).
    """
    by_output = cotangent.transpose(1, 2, 0)
    weights = np.conjugate(by_output, out=np.empty(by_output.shape, complex))
    if solution.output_factor is not None:  # then all that follows is about H before the factor
        weights = weights * solution.output_factor[:, None]
    adjoint = solution.solver.solve(weights, transposed=True, through=solution.readout.T)
    is_irregular = [_has_irregular_slopes(solution, of_part) for of_part in slopes]
    if any(is_irregular):
        return _gradient_with_shapes(solution, slopes, weights, adjoint, is_irregular)
    return _polynomial_gradient(solution, slopes, weights, adjoint)


def _polynomial_gradient(
    solution: FrfSolution, slopes: Slopes, weights: Complex, adjoint: Complex
) -> Real:
    """Return the gradient by parameters of Parts whose slopes are polynomials in s."""
    powers = _powers(solution.motion, solution.request.laplace)
    slots = {change.slot for part in slopes for change in part}
    cotangents = None
    if slots - {"joint"}:
        cotangents = _slot_cotangents(solution, slots, weights, adjoint)
    flat = _flatten_lines(adjoint).conj().view(float)
    totals = []
    for part, of_part in zip(solution.model.parts, slopes, strict=True):
        total = np.zeros(len(part.parameters))
        for change in of_part:
            if change.slot == "joint" or cotangents is None:
                projected = -_project_joints(change, flat, powers)
            else:
                projected = _project(solution, change, cotangents)
            total += change.core.reshape(len(total), projected.size) @ projected.ravel()
        totals.append(total)
    return np.concatenate([*totals, np.zeros(0)])


def _has_irregular_slopes(solution: FrfSolution, slopes: tuple[Change, ...]) -> bool:
    """Return whether sums over powers of s cannot represent all of these slopes."""
    has_body_terms = any(
        term.body_left.any() or term.body_right.any()
        for term in solution.assembly.frequency_dependent
    )
    return any(
        change.shape is not None
        or change.slot == "input"
        or (has_body_terms and change.slot == "path")
        for change in slopes
    )


def _gradient_with_shapes(
    solution: FrfSolution,
    slopes: Slopes,
    weights: Complex,
    adjoint: Complex,
    is_irregular: list[bool],
) -> Real:
    """Return the gradient, with forward sensitivities for Parts with irregular slopes.

    Args:
        weights: conj(W); (n_out, n_in, n_freq).
        adjoint: a; (nv, n_in, n_freq).
        is_irregular: for each Part.
    """
    regular = [
        () if irregular else of_part
        for irregular, of_part in zip(is_irregular, slopes, strict=True)
    ]
    total = _polynomial_gradient(solution, regular, weights, adjoint)
    parameters = np.repeat(is_irregular, [len(part.parameters) for part in solution.model.parts])
    total[parameters] = ForwardSensitivities(solution, slopes, parameters).vector_jacobian_product(
        weights, adjoint
    )
    return total


def _powers(motion: Complex, laplace: Complex) -> Callable[[int], Complex]:
    """Return a function of p for s^p x, flat over inputs and lines, each computed once."""

    @cache
    def power(exponent: int) -> Complex:
        if exponent == 0:
            return _flatten_lines(motion)
        lower = power(exponent - 1).reshape(motion.shape)
        return _flatten_lines(lower * laplace)

    return power


def _project_joints(change: Change, adjoint: Real, powers: Callable[[int], Complex]) -> Real:
    """Return left' Re sum a (s^p x)' right for the powers of a change; (3, r, t)."""
    rows, columns = _row_span(change.left), _row_span(change.right)
    projected = np.zeros(change.core.shape[-3:])
    for power in np.flatnonzero(change.core.any(axis=(0, 2, 3))):
        inner = adjoint[rows] @ powers(int(power))[columns].view(float).T
        projected[power] = change.left[rows].T @ inner @ change.right[columns]
    return projected


@dataclass(frozen=True, eq=False)
class _SlotCotangents:
    """Cotangent S of every slot with dJ = <S, change>; None where no Part acts."""

    body: Real | None
    path: Real | None
    sensor: Real | None
    hammer: Real | None
    output: Real | None = None


def _slot_cotangents(
    solution: FrfSolution, slots: set[Slot], weights: Complex, adjoint: Complex
) -> _SlotCotangents:
    """Return the cotangents of the slots that Parts change."""
    by_output = _output_cotangent(solution, weights) if "output" in slots else None
    if not slots - {"joint", "output"}:
        return _SlotCotangents(None, None, None, None, by_output)
    sums = _motion_sums(solution, adjoint)
    drive_sums = _drive_sums(solution, adjoint)
    jacobian, ports = solution.assembly.jacobian, solution.ports
    readout_sums = None
    if slots & {"path", "sensor"}:
        readout_sums = (
            _flatten_lines(weights).conj().view(float)
            @ _flatten_lines(solution.motion).view(float).T
        )
    by_jacobian, by_inertia = _gravity_cotangents(solution, sums[0])
    body = sensor = hammer = path = None
    if "body" in slots:
        body = -jacobian @ sums @ jacobian.T
        body[2] += by_inertia - jacobian @ drive_sums @ ports.floor.T
    if readout_sums is not None and "sensor" in slots:
        sensor = readout_sums @ jacobian.T + (weights @ solution.floor_factor).real @ ports.floor.T
    if "hammer" in slots:
        hammer = (jacobian @ drive_sums).T
    if readout_sums is not None and "path" in slots:
        path = ports.readout.T @ readout_sums + by_jacobian
        zb = solution.assembly.body
        path += (ports.force - zb[2] @ ports.floor) @ drive_sums.T
        for power in np.flatnonzero(zb.any(axis=(1, 2))):
            path -= zb[power].T @ jacobian @ sums[power] + zb[power] @ jacobian @ sums[power].T
    return _SlotCotangents(body, path, sensor, hammer, by_output)


def _output_cotangent(solution: FrfSolution, weights: Complex) -> Real:
    """Return Re sum s^p W H over lines and inputs, p = 0, 1, 2; (3, n_out).

    A change dc of the logarithm of a channel's factor changes its FRFs by H dc.
    """
    products = (weights * solution.ideal_values.transpose(1, 2, 0)).sum(axis=1)
    powers = solution.request.laplace ** np.arange(3)[:, None]
    return (powers @ products.T).real


def _motion_sums(solution: FrfSolution, adjoint: Complex) -> Real:
    """Return Re sum a (s^p x)' over lines and inputs, p = 0, 1, 2; (3, nv, nv)."""
    left = _flatten_lines(adjoint).conj().view(float)
    powers = _powers(solution.motion, solution.request.laplace)
    return np.stack([left @ powers(power).view(float).T for power in range(3)])


def _drive_sums(solution: FrfSolution, adjoint: Complex) -> Real:
    """Return Re sum a s^q over lines; (nv, n_in)."""
    return (adjoint * solution.drive_factor).sum(axis=-1).real


def _gravity_cotangents(solution: FrfSolution, sums: Real) -> tuple[Real, Real]:
    """Return the cotangents of T and Mb by the stiffness of gravity."""
    assembly = solution.assembly
    machine = assembly.machine
    if not assembly.has_weight:
        return np.zeros_like(assembly.jacobian), np.zeros_like(machine.body_mass)
    by_jacobian, by_weight_bearing = gravity_adjoint(
        machine.weight,
        assembly.jacobian,
        assembly.weight_bearing_mass,
        -sums,
    )
    return by_jacobian, machine.weight_fraction[:, None] * by_weight_bearing


def _project(solution: FrfSolution, change: Change, cotangents: _SlotCotangents) -> Real:
    """Return left' S right for every power of s; (3, r, t)."""
    if change.slot == "body" and cotangents.body is not None:
        rows, columns = _nonzero_rows(change.left), _nonzero_rows(change.right)
        inner = cotangents.body[:, rows[:, None], columns]
        return change.left[rows].T @ inner @ change.right[columns]
    if change.slot == "output" and cotangents.output is not None:
        selected = output_selection(solution.request.outputs, change.point) @ change.left
        return np.asarray((cotangents.output @ selected)[:, :, None] * change.right[0])
    constant = np.zeros(change.core.shape[-3:])
    if change.slot == "path":
        cotangent = cotangents.path
    else:
        is_sensor = change.slot == "sensor"
        labels = solution.request.outputs if is_sensor else solution.request.inputs
        of_directions = cotangents.sensor if is_sensor else cotangents.hammer
        cotangent = (
            None
            if of_directions is None
            else direction_selection(labels, change.point).T @ of_directions
        )
    if cotangent is not None:
        constant[0] = change.left.T @ cotangent @ change.right
    return constant


def _nonzero_rows(frame: Real) -> np.ndarray:
    """Return the numbers of rows that are not zero."""
    return np.flatnonzero(frame.any(axis=1))


def _row_span(frame: Real) -> slice:
    """Return a slice from the first to the last row that is not zero: it copies nothing."""
    rows = _nonzero_rows(frame)
    return slice(int(rows[0]), int(rows[-1]) + 1) if rows.size else slice(0)


def _flatten_lines(array: Complex) -> Complex:
    """Return (n, m, n_freq) as (n, m n_freq), contiguous."""
    return np.ascontiguousarray(array).reshape(len(array), -1)
