r"""How FRFs follow every parameter of a refit, to first order: J of the linearised refit.

Stiffness and damping by their logarithms, tolerances by one standard deviation each. With the
equations of a machine, its sensors L and its hammers P,

    A X = P,  A = [[Z, G^T], [G, 0]],   dH = s^2 (dL X + L A^-1 (dP - dA X)),

in which dA, dL and dP are exact, or central differences of matrices where a place moves. A sensor's
own errors move its three rows alone, so that their columns are kept apart.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.campaign.draw import Tolerance
from truth.machine.couplings import coupled_matrices, tendon_rows
from truth.machine.dynamics import (
    Equations,
    hammer_columns,
    joint_matrices,
    joint_rows,
    motion_row,
    point_row,
    sensor_rows,
)
from truth.machine.machine_on_test import Machine
from truth.machine.rig import Occasion
from truth.machine.station import Complex, Hammer, Mask, Real, Stage, Station

_STEP = 1e-3  # of a tolerance's standard deviation, for differences of matrices


@dataclass(frozen=True, eq=False)
class Jacobian:
    """J of a machine without effects, over the standard deviations of the values.

    Args:
        shared: of all parameters but the sensors'; (2 n_value, n), as ``stacked``.
        bounded: which of those are tolerances; (n,).
        own: of each sensor's gains, angles and position, and where they have a tolerance its
            cross-talk and delays, its three rows alone; (n_sensor, 2 n_own, 9 to 15).
    """

    shared: Real
    bounded: Mask
    own: Real


def jacobian(machine: Machine, freq_hz: Real, tolerance: Tolerance, weight: Real) -> Jacobian:
    """Linearise a machine's FRFs.

    Args:
        machine: the true one, without effects.
        freq_hz: lines [Hz]; (n_line,).
        tolerance: standard deviations of the priors.
        weight: of each value, one over its standard deviation; (n_line, n_out, n_in).
    """
    solved = _Solved(machine, freq_hz)
    shared, bounded = [], []
    for slopes, prior in _parameters(machine, tolerance):
        shared.append(stacked(solved.slope(slopes) * weight))
        bounded.append(prior)
    for change in _force_channels(solved, machine.hammers, tolerance):
        shared.append(stacked(change * weight))
        bounded.append(True)
    own = _sensor_columns(solved, machine.station, tolerance, weight)
    return Jacobian(np.array(shared).T, np.array(bounded), own)


def jacobian_again(machine: Machine, freq_hz: Real, weight: Real, before: Jacobian) -> Jacobian:
    """The same about other stiffness and damping, the slopes by tolerances as before.

    Args:
        machine: with the others.
        freq_hz: lines [Hz]; (n_line,).
        weight: of each value; (n_line, n_out, n_in).
        before: J of the machine.
    """
    solved, shared = _Solved(machine, freq_hz), np.array(before.shared)
    joints = [
        own
        for index in range(len(machine.station.stages))
        for own in _joints(machine.station, index)
    ]
    springs = [*joints, *_tendons(machine.station)]
    columns = [stacked(solved.slope(slopes) * weight) for slopes in springs]
    shared[:, ~before.bounded] = np.array(columns).T
    return replace(before, shared=shared)


def stacked(values: Complex) -> Real:
    """Real parts above imaginary parts, in one column."""
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def unstacked(values: Real, shape: tuple[int, ...]) -> Complex:
    """The complex values again."""
    real, imag = values.reshape(2, *shape)
    return np.asarray(real + 1j * imag)


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Matrices' slopes by one parameter; what does not move is None."""

    equations: Equations | None = None
    sensors: Real | None = None
    hammers: Real | None = None


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
        delays = [sensor.delay for _, sensor in machine.station.sensors()]
        self.late = np.exp(-self.s * np.concatenate(delays)[:, None])

    @property
    def values(self) -> Complex:
        """The accelerances; (n_line, n_out, n_in)."""
        inside = self.motion[:, : self.size]
        return np.asarray(self.s**2 * self.late * (self.sensors @ inside))

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
        return np.asarray(self.s**2 * self.late * total)


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
    for slopes in _tendons(machine.station):
        yield slopes, False
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


def _tendons(station: Station) -> Iterator[_Slopes]:
    """By log k and log c of the tendons."""
    if not station.tendons:
        return
    for tendon, row in zip(station.tendons, tendon_rows(station), strict=True):
        square = np.outer(row, row)
        yield _matrices(station, stiffness=tendon.stiffness * square)
        yield _matrices(station, damping=tendon.damping * square)


def _weights(station: Station, index: int, tolerance: Tolerance) -> Iterator[_Slopes]:
    """By mass and by each of the six numbers of the inertia."""
    stage, size = station.stages[index], 6 * len(station.stages)
    mass = np.zeros((size, size))
    place = slice(6 * index, 6 * index + 3)
    mass[place, place] = tolerance.mass * stage.mass * np.eye(3)
    heavier = replace(stage, mass=stage.mass * (1 + tolerance.mass))
    weight = None
    if station.gravity.any():  # linear in the mass
        stages = (*station.stages[:index], heavier, *station.stages[index + 1 :])
        whole = coupled_matrices(replace(station, stages=stages)).stiffness
        weight = whole - coupled_matrices(station).stiffness
    yield _matrices(station, mass=mass, stiffness=weight)
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
    """Central difference of M, C, K and G, of which the joints of a few stages alone move."""
    sizes = [6 - len(stage.joints) for stage in ends[0].stages]
    size = 6 * len(sizes)
    mass, damping, stiffness = np.zeros((3, size, size))
    rigid = np.zeros((sum(sizes), size))
    coupled = [coupled_matrices(station) for station in ends]
    mass += coupled[0].mass - coupled[1].mass
    damping += coupled[0].damping - coupled[1].damping
    stiffness += coupled[0].stiffness - coupled[1].stiffness
    for index in indices:
        one, other = (joint_matrices(station, index) for station in ends)
        damping += one[0] - other[0]
        stiffness += one[1] - other[1]
        first = sum(sizes[:index])
        rigid[first : first + sizes[index]] = one[2] - other[2]
    over = 1 / (2 * _STEP)
    return Equations(mass * over, damping * over, stiffness * over, rigid * over)


def _hits(machine: Machine, number: int, tolerance: Tolerance) -> Iterator[_Slopes]:
    """By the direction and the place of one hammer."""
    hammer = machine.hammers[number]
    if hammer.along:  # a motor acts as the model says
        return
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


def _force_channels(
    solved: _Solved, hammers: tuple[Hammer, ...], tolerance: Tolerance
) -> Iterator[Complex]:
    """By gain and delay of each force channel, those with a tolerance; like the FRFs."""
    for instrument in dict.fromkeys(hammer.instrument for hammer in hammers):
        own = np.array([hammer.instrument == instrument for hammer in hammers])
        if tolerance.hammer_gain:
            yield tolerance.hammer_gain * solved.values * own
        if tolerance.hammer_delay:
            yield -tolerance.hammer_delay * solved.s * solved.values * own


def _sensor_columns(solved: _Solved, station: Station, tolerance: Tolerance, weight: Real) -> Real:
    """J of each sensor on its three rows; (n_sensor, 2 n_value, 9 to 15).

    The columns are gains, angles, position, then cross-talk and delays if they have a tolerance.
    """
    found = []
    motion = solved.s**2 * solved.motion[:, : solved.size]
    for number, (index, sensor) in enumerate(station.sensors()):
        place, stage = slice(6 * index, 6 * index + 6), station.stages[index]
        rows = slice(3 * number, 3 * number + 3)
        drawn = solved.sensors[rows, place]
        along = np.array([point_row(stage, sensor.position, one) for one in sensor.axes])
        late = solved.late[:, rows]
        columns = []
        for axis in np.eye(3):
            gain = tolerance.sensor_gain * axis[:, None] * (sensor.gain[:, None] * along)
            turned = np.cross(tolerance.sensor_angle * axis, sensor.axes)
            lever = tolerance.sensor_position * axis
            angle = np.array([point_row(stage, sensor.position, one) for one in turned])
            shift = np.array([[0.0, 0.0, 0.0, *np.cross(lever, one)] for one in sensor.axes])
            for row in (gain, sensor.mixing @ angle, sensor.mixing @ shift):
                columns.append(stacked(late * (row @ motion[:, place]) * weight[:, rows]))
        for first, second in ((0, 1), (0, 2), (1, 2)) if tolerance.sensor_cross else ():
            row = np.zeros_like(along)
            row[first], row[second] = along[second], along[first]
            row *= tolerance.sensor_cross
            columns.append(stacked(late * (row @ motion[:, place]) * weight[:, rows]))
        for axis in np.eye(3) if tolerance.sensor_delay else ():
            reading = -solved.s * axis[:, None] * (drawn @ motion[:, place])
            columns.append(stacked(tolerance.sensor_delay * late * reading * weight[:, rows]))
        found.append(np.array(columns).T)
    return np.array(found)
