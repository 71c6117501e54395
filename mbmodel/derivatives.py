r"""Exact derivatives of H(s) = s^q [L T Z^-1 F + L U / s^2], F = T' B + motors, B = P - Mb U.

With x = s^q Z^-1 F and b = T x + U s^(q - 2), the motion of the bodies, a small change gives

    dH = dL b + L dT x                                         sensors, kinematics
       - y' dZj x - y' T' (dZb T x + dMb U s^q)                joints, bodies
       - y' (dT' Zb T + T' Zb dT) x + s^q y' (dT' B + T' dP)   kinematics again, hammer

with y = Z^-T T' L' (s^2 dMb + ... = dZb; gravity adds what T and Mb do to its stiffness). A scalar
cost with cotangent W, dJ = Re sum conj(W) dH, needs one more solve, a = Z^-T G' conj(W), whatever
the number of parameters (the adjoint method): every slot then has one real matrix S with
dJ = sum <S, change>, summed over lines and inputs once for all parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from identification.words import Complex, Real
from mbmodel.gravity import gravity_adjoint, gravity_slope
from mbmodel.modal import real_times
from mbmodel.parts import Change, Slot
from mbmodel.places import selection
from mbmodel.solved import Solved

Slopes = Sequence[tuple[Change, ...]]


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


def columns(lines: Solved, slopes: Slopes) -> Complex:
    """Derivative of every FRF by every parameter; (n_freq, n_out, n_in, n_parameter)."""
    readers = lines.solver.solve(lines.readout.T[:, :, None], transposed=True)
    total = np.zeros((len(lines.theta), len(lines.readout), *lines.motion.shape[1:]), complex)
    forward = _Forward(lines, readers)
    start = 0
    for own, part in zip(slopes, lines.model.parts, strict=True):
        for change in own:
            forward.add(total[start : start + len(part.parameters)], change)
        start += len(part.parameters)
    return total.transpose(3, 1, 2, 0)


@dataclass(frozen=True, eq=False)
class _Forward:
    """Adds dH of a slope, parameter by parameter.

    Args:
        lines: the model linearised at theta.
        readers: y = Z^-T G'; (nv, n_out, n_freq).
    """

    lines: Solved
    readers: Complex

    def add(self, total: Complex, change: Change) -> None:
        """Add the derivatives by a Part's parameters; total is (n_own, n_out, n_in, n_freq)."""
        lines = self.lines
        jacobian = lines.assembly.jacobian
        if change.slot == "joint":
            self._add_impedance(total, change.core, change.left, change.right)
        elif change.slot == "body":
            left, right = jacobian.T @ change.left, jacobian.T @ change.right
            self._add_impedance(total, change.core, left, right)
            for own, core in zip(total, change.core, strict=True):
                inertia = change.left @ core[2] @ change.right.T
                self._add_drive(own, -jacobian.T @ (inertia @ lines.places.floor))
                weighed = lines.model.machine.weighed[:, None]
                self._add_weight(own, inertia_change=weighed * inertia)
        elif change.slot == "path":
            for own, core in zip(total, change.core, strict=True):
                self._add_path(own, change.left @ core[0] @ change.right.T)
        else:
            for own, core in zip(total, change.core, strict=True):
                self._add_point(own, change, change.left @ core[0] @ change.right.T)

    def _add_impedance(self, total: Complex, core: Real, left: Real, right: Real) -> None:
        """- y' (left core right') x for every power of s."""
        lines = self.lines
        read, felt = real_times(left.T, self.readers), real_times(right.T, lines.motion)
        for p, power, i, j in np.argwhere(core):
            scaled = read[i] * (-core[p, power, i, j] * lines.question.laplace**power)
            total[p] += np.einsum("of,mf->omf", scaled, felt[j])

    def _add_drive(self, total: Complex, drive: Real) -> None:
        """s^q y' dF; (nv, n_in)."""
        if drive.any():
            lines = self.lines
            total += np.einsum("vof,vm->omf", self.readers, drive) * lines.question.factor

    def _add_weight(self, total: Complex, **change: Real) -> None:
        """- y' dK x of gravity."""
        assembly, machine = self.lines.assembly, self.lines.model.machine
        if assembly.has_weight:
            slope = gravity_slope(
                machine.gravity, machine.order, assembly.jacobian, assembly.heavy, **change
            )
            pressed = real_times(slope, self.lines.motion)
            total -= np.einsum("vof,vmf->omf", self.readers, pressed)

    def _add_path(self, total: Complex, change: Real) -> None:
        lines = self.lines
        assembly, here = lines.assembly, lines.places
        total += real_times(here.readout @ change, lines.motion)
        for power in np.flatnonzero(assembly.body.any(axis=(1, 2))):
            zb = assembly.body[power]
            slope = change.T @ zb @ assembly.jacobian + assembly.jacobian.T @ zb @ change
            pressed = real_times(slope, lines.motion) * lines.question.laplace**power
            total -= np.einsum("vof,vmf->omf", self.readers, pressed)
        self._add_drive(total, change.T @ (here.force - assembly.body[2] @ here.floor))
        self._add_weight(total, jacobian_change=change)

    def _add_point(self, total: Complex, change: Change, rows: Real) -> None:
        lines = self.lines
        jacobian, here = lines.assembly.jacobian, lines.places
        if change.slot == "hammer":
            pushed = (selection(lines.question.inputs, change.point) @ rows).T
            self._add_drive(total, jacobian.T @ pushed)
            return
        read = selection(lines.question.outputs, change.point) @ rows
        total += real_times(read @ jacobian, lines.motion)
        if here.has_floor:
            total += (read @ here.floor)[:, :, None] * lines.carrying


def _flat(array: Complex) -> Complex:
    """(n, m, n_freq) as (n, m n_freq), contiguous."""
    flat: Complex = np.ascontiguousarray(array).reshape(len(array), -1)
    return flat
