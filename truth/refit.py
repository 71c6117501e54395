r"""How much of an effect survives a refit: one linearised refit at the truth.

A user who does not know the effect tunes stiffness and damping, and every tolerance within 2.5 of
its standard deviations. To first order about the true machine the FRFs then follow

    min_x  sum |(r - J x) / sd|^2 + sum_tolerances x^2,   |x_tolerance| <= 2.5,

r being what the effect changes, J the slopes by log k, log c and by each tolerance in units of its
standard deviation. What remains of r, against the noise as the excess of a campaign has it, is

    ratio^2 = mean over channels of  sum_f |r - J x|^2 / sum_f sd^2,

the survival ratio sqrt(e1^2 - e0^2) / e0 of the excess e1 with the effect and e0 without it, since
about the truth e0 = 1. Slopes come from dA, differences of the assembled matrices:

    A X = P,  A = [[Z, G^T], [G, 0]],   dH = s^2 (dL X + L A^-1 (dP - dA X)).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg
from scipy.linalg import blas

from truth.draw import Tolerance
from truth.dynamics import (
    Equations,
    hammer_columns,
    joint_matrices,
    joint_rows,
    motion_row,
    point_row,
    sensor_rows,
)
from truth.machine import Known, Machine
from truth.measure import (
    FORCE_NOISE,
    PULSE_SECONDS,
    linear_frfs,
    noise_spectrum,
    nonlinear_part,
    pulse_spectra,
)
from truth.nonlinear import Pulses
from truth.protocol import Protocol, Take
from truth.rig import Occasion
from truth.station import Complex, Mask, Real, Stage, Station

BOUND = 2.5  # standard deviations within which a tolerance is kept
_LINES = 120  # lines of the refit
_LOWEST_HZ = 5.0  # below, the building's noise drowns a hammer test
_STEP = 1e-3  # of a tolerance's standard deviation, for differences of matrices
_ROUNDS = 30
_COARSE_HZ = 4096.0  # samples per second of nonlinear joints, when only a size is looked for
_RIDGE = 1e-13  # of the diagonal: a joint that no sensor sees


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Matrices' slopes by one parameter; what does not move is None."""

    equations: Equations | None = None
    sensors: Real | None = None
    hammers: Real | None = None


@dataclass(frozen=True, eq=False)
class Refit:
    """A linearised refit of one machine and test, ready for any effect.

    Args:
        machine: the true one, without effects.
        protocol: how it is tested.
        takes: its files of one level; every channel is in one of them.
        known: its accelerance at the refit's lines.
        deviation: sd of each value; (n_line, n_out, n_in).
        used: channels that count; (n_out,).
        shared: J of all but the sensors, over sd, real parts above imaginary; (2 n_value, n).
        own: the same of each sensor, its three rows alone; (n_sensor, 2 n_own, 9).
        normal: J^T J with the prior.
        bounded: which parameters are tolerances; (n_parameter,).
    """

    machine: Machine
    protocol: Protocol
    takes: tuple[Take, ...]
    known: Known
    deviation: Real
    used: Mask
    shared: Real
    own: Real
    normal: Real
    bounded: Mask

    def ratio(self, machine: Machine) -> float:
        """Return the survival ratio of the effects of a machine."""
        change = self.change(machine)
        left = change - self.fitted(change)
        power = (np.abs(left) ** 2).sum(axis=0) / (self.deviation**2).sum(axis=0)
        return float(np.sqrt(power[self.used].mean()))

    def change(self, machine: Machine) -> Complex:
        """What the effects change in the FRFs, as the hammer test would find; like deviation."""
        known, whole = Known(machine, self.known.freq_hz), Known(machine, self.protocol.freq_hz)
        base = self.known.on(Occasion(node=self.protocol.nodes[0]))[1]
        values = np.array(base)
        points = [sensor.node for _, sensor in machine.station.sensors()]
        pulse = Pulses(np.array([self.takes[0].level]), np.array([PULSE_SECONDS]))
        force = pulse_spectra(self.known.freq_hz, pulse)[0]
        places = np.searchsorted(self.protocol.freq_hz, self.known.freq_hz)
        for take in self.takes:
            rows = [3 * points.index(node) + axis - 1 for node, axis in take.channels]
            occasions = [
                Occasion(take.level, node, axis, take.setup)
                for node in self.protocol.nodes
                for axis in range(3)
            ]
            added = None
            if known.on(occasions[0])[0].joints:
                added = nonlinear_part(whole, occasions, [pulse] * len(occasions), _COARSE_HZ)
            for number, occasion in enumerate(occasions):
                column = machine.column(occasion)
                mean = linear_frfs(known, occasion, self.protocol.averages).mean(axis=0)
                if added is not None:
                    mean = mean + added[number][0][places] / force[:, None]
                values[:, rows, column] = mean[:, rows]
        return values - base

    def fitted(self, change: Complex) -> Complex:
        """What stiffness, damping and tolerances can follow of a change of the FRFs."""
        weighted = _stacked(change / self.deviation * self.used[:, None])
        right = self._adjoint(weighted)
        solution = _bounded(self.normal, right, self.bounded)
        split = self.shared.shape[1]
        values = self.shared @ solution[:split]
        found = _unstacked(values, change.shape)
        sensors = solution[split:].reshape(len(self.own), -1)
        for number, (columns, own) in enumerate(zip(self.own, sensors, strict=True)):
            rows = slice(3 * number, 3 * number + 3)
            found[:, rows] += _unstacked(columns @ own, found[:, rows].shape)
        return found * self.deviation

    def _adjoint(self, weighted: Real) -> Real:
        whole = _unstacked(weighted, self.deviation.shape)
        own = [
            columns.T @ _stacked(whole[:, 3 * number : 3 * number + 3])
            for number, columns in enumerate(self.own)
        ]
        return np.concatenate([self.shared.T @ weighted, *own])


def refit_of(
    machine: Machine,
    protocol: Protocol,
    takes: tuple[Take, ...],
    tolerance: Tolerance,
) -> Refit:
    """Linearise a machine without effects at a part of its lines.

    Args:
        machine: the true one, its effects are left out.
        protocol: how it is tested.
        takes: the files of one level.
        tolerance: standard deviations of the priors.
    """
    plain = replace(machine, effects=())
    lines = _chosen(protocol)
    known = Known(plain, lines)
    base = known.on(Occasion(node=protocol.nodes[0]))[1]
    deviation = _deviation(base, lines, protocol, takes[0].level)
    points = [(sensor.node, axis) for _, sensor in plain.station.sensors() for axis in (1, 2, 3)]
    used = np.array([point != protocol.dead for point in points])
    solved = _Solved(plain, lines)
    weight = used[:, None] / deviation
    shared, bounded = [], []
    for slopes, prior in _parameters(plain, tolerance):
        shared.append(_stacked(solved.slope(slopes) * weight))
        bounded.append(prior)
    columns = np.array(shared).T
    own = _sensor_columns(solved, plain.station, tolerance, weight)
    limits = np.array(bounded + [True] * (own.shape[0] * own.shape[2]))
    normal = _normal(columns, own, deviation.shape) + np.diag(limits.astype(float))
    return Refit(plain, protocol, takes, known, deviation, used, columns, own, normal, limits)


class _Solved:
    """X and L A^-1 of the machine, from which every slope follows."""

    def __init__(self, machine: Machine, freq_hz: Real) -> None:
        rig = machine.rig(Occasion())
        equations = rig.equations
        self.size, rigid = len(equations.mass), len(equations.rigid)
        self.s = 2j * np.pi * freq_hz[:, None, None]
        matrix = np.zeros((freq_hz.size, self.size + rigid, self.size + rigid), np.complex128)
        inner = equations.stiffness + self.s * equations.damping + self.s**2 * equations.mass
        matrix[:, : self.size, : self.size] = inner
        self.scale = float(np.abs(equations.stiffness).max()) if rigid else 1.0
        matrix[:, : self.size, self.size :] = self.scale * equations.rigid.T
        matrix[:, self.size :, : self.size] = self.scale * equations.rigid
        inverse = np.linalg.inv(matrix)
        self.sensors = rig.readout
        self.left = rig.readout @ inverse[:, : self.size]
        self.motion = inverse[:, :, : self.size] @ rig.drive

    def slope(self, slopes: _Slopes) -> Complex:
        """Return dH of one parameter; (n_line, n_out, n_in)."""
        inside = self.motion[:, : self.size]
        total: Complex = np.zeros((1, 1, 1), np.complex128)
        if slopes.equations is not None:
            by = slopes.equations
            full = abs(by.stiffness) + abs(by.damping) + abs(by.mass)
            rows, columns = np.flatnonzero(full.any(axis=1)), np.flatnonzero(full.any(axis=0))
            block = np.ix_(rows, columns)  # a few coordinates alone are moved by one parameter
            inner = by.stiffness[block] + self.s * by.damping[block] + self.s**2 * by.mass[block]
            total = total - self.left[:, :, rows] @ (inner @ inside[:, columns])
            if by.rigid.any():
                ties = self.scale * by.rigid
                total = total - self.left[:, :, : self.size] @ (
                    ties.T @ self.motion[:, self.size :]
                )
                total = total - self.left[:, :, self.size :] @ (ties @ inside)
        if slopes.hammers is not None:
            total = total + self.left[:, :, : self.size] @ slopes.hammers
        if slopes.sensors is not None:
            total = total + slopes.sensors @ inside
        return np.asarray(self.s**2 * total)


def _parameters(machine: Machine, tolerance: Tolerance) -> Iterator[tuple[_Slopes, bool]]:
    """Slopes by every parameter but the sensors', and whether it is a tolerance."""
    for index in range(len(machine.station.stages)):
        for slopes in _joints(machine.station, index):
            yield slopes, False
        for slopes in (
            *_weights(machine.station, index, tolerance),
            *_places(machine, index, tolerance),
        ):
            yield slopes, True
    for number in range(len(machine.hammers)):
        for slopes in _hits(machine, number, tolerance):
            yield slopes, True


def _joints(station: Station, index: int) -> Iterator[_Slopes]:
    """By log k and log c of a stage's joints."""
    moving, _ = joint_rows(station, index)
    for joint, row in zip(station.stages[index].joints, moving, strict=True):
        square = np.outer(row, row)
        yield _matrices(station, stiffness=joint.stiffness * square)
        yield _matrices(station, damping=joint.damping * square)


def _weights(station: Station, index: int, tolerance: Tolerance) -> Iterator[_Slopes]:
    """By mass and by each of the six numbers of the inertia."""
    stage, size = station.stages[index], 6 * len(station.stages)
    mass = np.zeros((size, size))
    place = slice(6 * index, 6 * index + 3)
    mass[place, place] = tolerance.mass * stage.mass * np.eye(3)
    yield _matrices(station, mass=mass)
    for row, column in zip(*np.triu_indices(3), strict=True):
        mass = np.zeros((size, size))
        one, other = 6 * index + 3 + row, 6 * index + 3 + column
        mass[one, other] = mass[other, one] = tolerance.inertia * stage.inertia[row, column]
        yield _matrices(station, mass=mass)


def _matrices(
    station: Station,
    mass: Real | None = None,
    damping: Real | None = None,
    stiffness: Real | None = None,
) -> _Slopes:
    size = 6 * len(station.stages)
    still = np.zeros((size, size))
    rigid = np.zeros((sum(6 - len(stage.joints) for stage in station.stages), size))
    given = [still if matrix is None else matrix for matrix in (mass, damping, stiffness)]
    return _Slopes(Equations(given[0], given[1], given[2], rigid))


def _places(machine: Machine, index: int, tolerance: Tolerance) -> Iterator[_Slopes]:
    """By a stage's centre of mass and by the place that its joints share."""
    station, stage = machine.station, machine.station.stages[index]
    children = [i for i, one in enumerate(station.stages) if one.parent == index]
    for axis in np.eye(3):
        ends = _ends(station, index, partial(_with_com, stage, tolerance.com * axis))
        over = 1 / (2 * _STEP)
        yield _Slopes(
            _slope_of_joints(ends, (index, *children)),
            (sensor_rows(ends[0]) - sensor_rows(ends[1])) * over,
            (hammer_columns(ends[0], machine.hammers) - hammer_columns(ends[1], machine.hammers))
            * over,
        )
        if stage.joints:
            by = tolerance.joint_position * axis
            yield _Slopes(
                _slope_of_joints(_ends(station, index, partial(_moved, stage, by)), (index,))
            )


def _with_com(stage: Stage, shift: Real, way: float) -> Stage:
    return replace(stage, com=stage.com + way * shift)


def _moved(stage: Stage, shift: Real, way: float) -> Stage:
    joints = tuple(replace(one, position=one.position + way * shift) for one in stage.joints)
    return replace(stage, joints=joints)


def _ends(station: Station, index: int, moved: Callable[[float], Stage]) -> tuple[Station, Station]:
    """The station with a stage a step to either side."""
    found = []
    for way in (_STEP, -_STEP):
        stages = list(station.stages)
        stages[index] = moved(way)
        found.append(replace(station, stages=tuple(stages)))
    return found[0], found[1]


def _slope_of_joints(ends: tuple[Station, Station], indices: tuple[int, ...]) -> Equations:
    """Central difference of C, K and G, of which the joints of a few stages alone move."""
    sizes = [6 - len(stage.joints) for stage in ends[0].stages]
    size = 6 * len(sizes)
    damping, stiffness = np.zeros((2, size, size))
    rigid = np.zeros((sum(sizes), size))
    for index in indices:
        one, other = (joint_matrices(station, index) for station in ends)
        damping += one[0] - other[0]
        stiffness += one[1] - other[1]
        first = sum(sizes[:index])
        rigid[first : first + sizes[index]] = one[2] - other[2]
    over = 1 / (2 * _STEP)
    return Equations(np.zeros((size, size)), damping * over, stiffness * over, rigid * over)


def _hits(machine: Machine, number: int, tolerance: Tolerance) -> Iterator[_Slopes]:
    """By the direction and the place of one hammer."""
    hammer = machine.hammers[number]
    for axis in np.eye(3):
        turn = tolerance.hammer_angle * np.cross(axis, hammer.direction)
        for direction, position in (
            (turn, hammer.position),
            (hammer.direction, tolerance.hammer_position * axis),
        ):
            column = motion_row(machine.station, hammer.stage, position, direction)
            if position is not hammer.position:  # a column is affine in the place
                column = column - motion_row(
                    machine.station, hammer.stage, np.zeros(3), hammer.direction
                )
                column[6 * hammer.stage : 6 * hammer.stage + 3] = 0.0
            columns = np.zeros((len(column), len(machine.hammers)))
            columns[:, number] = column
            yield _Slopes(hammers=columns)


def _sensor_columns(
    solved: "_Solved", station: Station, tolerance: Tolerance, weight: Real
) -> Real:
    """J of each sensor on its three rows: gains, angles, position; (n_sensor, 2 n_value, 9)."""
    found = []
    motion = solved.s**2 * solved.motion[:, : solved.size]
    for number, (index, sensor) in enumerate(station.sensors()):
        place, stage = slice(6 * index, 6 * index + 6), station.stages[index]
        rows = slice(3 * number, 3 * number + 3)
        drawn = solved.sensors[rows, place]
        columns = []
        for axis in np.eye(3):
            gain = tolerance.sensor_gain * axis[:, None] * drawn
            turned = np.cross(tolerance.sensor_angle * axis, sensor.axes)
            lever = tolerance.sensor_position * axis
            angle = np.array([point_row(stage, sensor.position, one) for one in turned])
            shift = np.array([[0.0, 0.0, 0.0, *np.cross(lever, one)] for one in sensor.axes])
            for row in (gain, sensor.gain[:, None] * angle, sensor.gain[:, None] * shift):
                columns.append(_stacked(row @ motion[:, place] * weight[:, rows]))
        found.append(np.array(columns).T)
    return np.array(found)


def _normal(shared: Real, own: Real, shape: tuple[int, ...]) -> Real:
    """J^T J: sensors meet the shared columns, never one another."""
    split, each = shared.shape[1], own.shape[2]
    normal = np.zeros((split + len(own) * each,) * 2)
    half = blas.dsyrk(1.0, shared, trans=1, lower=False)  # in Fortran's order: no copy
    normal[:split, :split] = np.triu(half) + np.triu(half, 1).T
    whole = shared.reshape(2, *shape, split)
    for number, columns in enumerate(own):
        rows = slice(3 * number, 3 * number + 3)
        here = slice(split + each * number, split + each * (number + 1))
        normal[here, here] = columns.T @ columns
        crossed = whole[:, :, rows].reshape(-1, split).T @ columns
        normal[:split, here], normal[here, :split] = crossed, crossed.T
    return normal


def _bounded(normal: Real, right: Real, bounded: Mask) -> Real:
    """Least x^T N x / 2 - b^T x with tolerances within their bound, by an active set."""
    scale = np.sqrt(np.diag(normal))
    held = np.zeros(len(right))
    for _ in range(_ROUNDS):
        free = held == 0
        solution = BOUND * held
        inner = normal[np.ix_(free, free)] / np.outer(scale[free], scale[free])
        inner[np.diag_indices_from(inner)] += _RIDGE
        push = (right[free] - normal[np.ix_(free, ~free)] @ solution[~free]) / scale[free]
        factor = scipy.linalg.cho_factor(inner)
        solution[free] = np.asarray(scipy.linalg.cho_solve(factor, push), np.float64) / scale[free]
        beyond = bounded & free & (np.abs(solution) > BOUND)
        slope = normal @ solution - right
        inward = ~free & (slope * held > 0)  # the cost falls where the bound is left
        if not beyond.any() and not inward.any():
            break
        held[beyond] = np.sign(solution[beyond])
        held[inward] = 0
    limit = np.where(bounded, BOUND, np.inf)
    return np.minimum(np.maximum(solution, -limit), limit)


def _chosen(protocol: Protocol) -> Real:
    """Lines of the refit, evenly from where a hammer test begins to tell."""
    lines = protocol.freq_hz[protocol.freq_hz >= _LOWEST_HZ]
    return lines[:: max(1, len(lines) // _LINES)]


def _deviation(base: Complex, lines: Real, protocol: Protocol, level: float) -> Real:
    """Standard deviation of H1, real plus imaginary part, as the hammer test will have it."""
    pulse = Pulses(np.array([level]), np.array([PULSE_SECONDS]))
    force = np.abs(pulse_spectra(lines, pulse)[0]) * np.sqrt(protocol.averages)
    spacing = protocol.freq_hz[1] - protocol.freq_hz[0]
    sensor = noise_spectrum(lines, spacing) / force
    hammer = FORCE_NOISE * np.abs(base) / np.sqrt(protocol.averages)
    deviation: Real = np.sqrt(sensor[:, None, None] ** 2 + hammer**2)
    return deviation


def _stacked(values: Complex) -> Real:
    """Real parts above imaginary parts, in one column."""
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def _unstacked(values: Real, shape: tuple[int, ...]) -> Complex:
    real, imag = values.reshape(2, *shape)
    return np.asarray(real + 1j * imag)
