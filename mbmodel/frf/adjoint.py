r"""Exact gradients of H(s) = s^q [L T Z^-1 F + L U / s^2], F = T' B + motors, B = P - Mb U.

With x = s^q Z^-1 F and b = T x + U s^(q - 2), the motion of the bodies, a small change gives

    dH = dL b + L dT x                                         sensors, kinematics
       - y' dZj x - y' T' (dZb T x + dMb U s^q)                joints, bodies
       - y' (dT' Zb T + T' Zb dT) x + s^q y' (dT' B + T' dP)   kinematics again, hammer

with y = Z^-T T' L' (s^2 dMb + ... = dZb; gravity adds what T and Mb do to its stiffness). A scalar
cost with cotangent W, dJ = Re sum conj(W) dH, needs one more solve, a = Z^-T G' conj(W), whatever
the number of parameters (the adjoint method): every slot then has one real matrix S with
dJ = sum <S, change>, summed over lines and inputs once for all parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from identification.words import Complex, Real
from mbmodel.frf.forward_sensitivities import Forward, Slopes
from mbmodel.frf.ports import selection
from mbmodel.frf.solution import Solved
from mbmodel.linearisation.gravity import gravity_adjoint
from mbmodel.parts import Change, Slot


def gradient(lines: Solved, slopes: Slopes, cotangent: Complex) -> Real:
    """Derivative of a scalar cost by every parameter.

    Args:
        lines: the model linearised at theta.
        slopes: of every Part.
        cotangent: W with dJ = Re sum conj(W) dH; (n_freq, n_out, n_in).

    Returns:
        (n_parameter,).
    """
    weights = np.ascontiguousarray(cotangent.conj().transpose(1, 2, 0))
    adjoint = lines.solver.solve(weights, transposed=True, through=lines.readout.T)
    odd = [_is_odd(lines, own) for own in slopes]
    if any(odd):
        return _by_shapes(lines, slopes, weights, adjoint, odd)
    return _gradient(lines, slopes, weights, adjoint)


def _gradient(lines: Solved, slopes: Slopes, weights: Complex, adjoint: Complex) -> Real:
    """The same of Parts without shapes of s."""
    powers = _powers(lines.motion, lines.question.laplace)
    slots = {change.slot for part in slopes for change in part}
    found = None
    if slots - {"joint"}:
        found = _sensitivities(lines, slots, weights, adjoint)
    flat = _flat(adjoint).conj().view(float)
    totals = []
    for part, own in zip(lines.model.parts, slopes, strict=True):
        total = np.zeros(len(part.parameters))
        for change in own:
            if change.slot == "joint" or found is None:
                projected = -_at_joints(change, flat, powers)
            else:
                projected = _projected(lines, change, found)
            total += change.core.reshape(len(total), projected.size) @ projected.ravel()
        totals.append(total)
    return np.concatenate([*totals, np.zeros(0)])


def _is_odd(lines: Solved, slopes: tuple[Change, ...]) -> bool:
    """Whether sums over powers of s do not hold all of these slopes."""
    hung = any(term.change.slot == "body" for term in lines.assembly.shaped)
    return any(change.shape is not None or (hung and change.slot == "path") for change in slopes)


def _by_shapes(
    lines: Solved, slopes: Slopes, weights: Complex, adjoint: Complex, odd: list[bool]
) -> Real:
    """The same, shape by shape for some Parts."""
    plain = [() if one else own for one, own in zip(odd, slopes, strict=True)]
    total = _gradient(lines, plain, weights, adjoint)
    places = np.repeat(odd, [len(part.parameters) for part in lines.model.parts])
    total[places] = Forward(lines, slopes, places).pulled(weights, adjoint)
    return total


def _powers(motion: Complex, laplace: Complex) -> Callable[[int], Complex]:
    """s^p x, flat over inputs and lines, each power made when first asked for."""

    @cache
    def power(exponent: int) -> Complex:
        if exponent == 0:
            return _flat(motion)
        lower = power(exponent - 1).reshape(motion.shape)
        return _flat(lower * laplace)

    return power


def _at_joints(change: Change, adjoint: Real, powers: Callable[[int], Complex]) -> Real:
    """Left' Re sum a (s^p x)' right for the powers of a change; (3, r, t)."""
    rows, columns = _span(change.left), _span(change.right)
    projected = np.zeros(change.core.shape[-3:])
    for power in np.flatnonzero(change.core.any(axis=(0, 2, 3))):
        inner = adjoint[rows] @ powers(int(power))[columns].view(float).T
        projected[power] = change.left[rows].T @ inner @ change.right[columns]
    return projected


@dataclass(frozen=True, eq=False)
class _Sensitivity:
    """S of every slot: dJ = <S, change>, for each power of s; absent where no Part acts."""

    body: Real | None
    path: Real | None
    sensor: Real | None
    hammer: Real | None


def _sensitivities(
    lines: Solved, slots: set[Slot], weights: Complex, adjoint: Complex
) -> _Sensitivity:
    sums = _motion_sums(lines, adjoint)
    driven = _drive_sums(lines, adjoint)
    jacobian, here = lines.assembly.jacobian, lines.places
    read = None
    if slots & {"path", "sensor"}:
        read = _flat(weights).conj().view(float) @ _flat(lines.motion).view(float).T
    by_jacobian, by_inertia = _by_gravity(lines, sums[0])
    body = sensor = hammer = path = None
    if "body" in slots:
        body = -jacobian @ sums @ jacobian.T
        body[2] += by_inertia - jacobian @ driven @ here.floor.T
    if read is not None and "sensor" in slots:
        sensor = read @ jacobian.T + (weights @ lines.carrying).real @ here.floor.T
    if "hammer" in slots:
        hammer = (jacobian @ driven).T
    if read is not None and "path" in slots:
        path = here.readout.T @ read + by_jacobian
        zb = lines.assembly.body
        path += (here.force - zb[2] @ here.floor) @ driven.T
        for power in np.flatnonzero(zb.any(axis=(1, 2))):
            path -= zb[power].T @ jacobian @ sums[power] + zb[power] @ jacobian @ sums[power].T
    return _Sensitivity(body, path, sensor, hammer)


def _motion_sums(lines: Solved, adjoint: Complex) -> Real:
    """Re sum a (s^p x)' over lines and inputs, p = 0, 1, 2; (3, nv, nv)."""
    left = _flat(adjoint).conj().view(float)
    powers = _powers(lines.motion, lines.question.laplace)
    return np.stack([left @ powers(power).view(float).T for power in range(3)])


def _drive_sums(lines: Solved, adjoint: Complex) -> Real:
    """Re sum a s^q over lines; (nv, n_in)."""
    total: Real = (adjoint @ lines.question.factor).real
    return total


def _by_gravity(lines: Solved, sums: Real) -> tuple[Real, Real]:
    assembly, machine = lines.assembly, lines.model.machine
    if not assembly.has_weight:
        return np.zeros_like(assembly.jacobian), np.zeros_like(machine.body_mass)
    by_jacobian, by_heavy = gravity_adjoint(
        machine.gravity, machine.order, assembly.jacobian, assembly.heavy, -sums
    )
    return by_jacobian, machine.weighed[:, None] * by_heavy


def _projected(lines: Solved, change: Change, found: _Sensitivity) -> Real:
    """Left' S right for every power of s; (3, r, t)."""
    if change.slot == "body" and found.body is not None:
        rows, columns = _support(change.left), _support(change.right)
        inner = found.body[:, rows[:, None], columns]
        projected: Real = change.left[rows].T @ inner @ change.right[columns]
        return projected
    constant = np.zeros(change.core.shape[-3:])
    if change.slot == "path":
        sensitivity = found.path
    else:
        is_sensor = change.slot == "sensor"
        asked = lines.question.outputs if is_sensor else lines.question.inputs
        whole = found.sensor if is_sensor else found.hammer
        sensitivity = None if whole is None else selection(asked, change.point).T @ whole
    if sensitivity is not None:
        constant[0] = change.left.T @ sensitivity @ change.right
    return constant


def _support(frame: Real) -> np.ndarray:
    return np.flatnonzero(frame.any(axis=1))


def _span(frame: Real) -> slice:
    """From the first to the last row that is not zero: a slice copies nothing."""
    rows = _support(frame)
    return slice(int(rows[0]), int(rows[-1]) + 1) if rows.size else slice(0)


def _flat(array: Complex) -> Complex:
    """(n, m, n_freq) as (n, m n_freq), contiguous."""
    flat: Complex = np.ascontiguousarray(array).reshape(len(array), -1)
    return flat
