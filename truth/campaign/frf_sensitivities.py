r"""How FRFs follow every parameter of a refit, to first order: J of the linearised refit.

With the equations of a machine, its sensors L and its hammers P,

    A X = P,  A = [[Z, G^T], [G, 0]],   dH = s^2 (dL X + L A^-1 (dP - dA X)).

``parameter_slopes`` has dA, dL and dP. A spring along a row g moves dA by k g^T g alone, so that
its slope is the product of what the sensors read of it, L A^-1 g^T, and of what each hit stretches
it, g X. A sensor's own errors move its three rows alone, so that their columns are kept apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from truth.campaign.draw import Tolerances
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.parameter_slopes import Slopes, Springs, list_springs, slopes_by_tolerances
from truth.machine.dynamics import Equations, point_row
from truth.machine.rig import Occasion
from truth.machine.station import Complex, Hammer, Real, Station

_TOGETHER = 8  # slopes of matrices in one product, whose values a cache holds


@dataclass(frozen=True, eq=False)
class Jacobian:
    """J of a machine without effects, over the standard deviations of the values.

    Values are those of ``stack_parts``; both matrices of all values are in Fortran's order.

    Args:
        springs: by log k and log c of each spring in turn; (2 n_value, 2 n_spring).
        tolerances: by all tolerances but the sensors'; (2 n_value, n_tolerance).
        of_sensors: by each sensor's gains, angles and position, and where they have a tolerance its
            cross-talk and delays, its three rows alone; (n_sensor, 2 n_own, 9 to 15).
    """

    springs: Real
    tolerances: Real
    of_sensors: Real

    def weighted_anew(self, before: Real, weight: Real) -> "Jacobian":
        """Return J over other standard deviations.

        Args:
            before: weight of each value so far; (n_line, n_out, n_in).
            weight: another, zero where the former is; like it.
        """
        ratio = np.divide(weight, before, out=np.zeros(weight.shape), where=before > 0)
        by_sensor = np.moveaxis(ratio.reshape(len(ratio), len(self.of_sensors), 3, -1), 1, 0)
        return Jacobian(
            self.springs * np.tile(ratio.ravel(), 2)[:, None],
            self.tolerances * np.tile(ratio.ravel(), 2)[:, None],
            self.of_sensors * np.tile(by_sensor.reshape(len(self.of_sensors), -1), 2)[..., None],
        )


def jacobian(machine: TrueMachine, freq_hz: Real, tolerance: Tolerances, weight: Real) -> Jacobian:
    """Linearise a machine's FRFs.

    Args:
        machine: the true one, without effects.
        freq_hz: lines [Hz]; (n_line,).
        weight: of each value, one over its standard deviation; (n_line, n_out, n_in).
    """
    solved = _Solved(machine, freq_hz, weight)
    return Jacobian(
        solved.springs(list_springs(machine.station)),
        solved.tolerances(list(slopes_by_tolerances(machine, tolerance)), machine, tolerance),
        _sensor_columns(solved, machine.station, tolerance, weight),
    )


def jacobian_again(machine: TrueMachine, freq_hz: Real, weight: Real, before: Jacobian) -> Jacobian:
    """Linearise FRFs about other stiffness and damping, and keep the slopes by tolerances.

    Args:
        machine: with the others.
        freq_hz: lines [Hz]; (n_line,).
        weight: of each value; (n_line, n_out, n_in).
        before: J of the machine.
    """
    solved = _Solved(machine, freq_hz, weight)
    return replace(before, springs=solved.springs(list_springs(machine.station)))


def stack_parts(values: Complex) -> Real:
    """Real parts above imaginary parts, in one column."""
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def join_parts(values: Real, shape: tuple[int, ...]) -> Complex:
    """The complex values again."""
    real, imag = values.reshape(2, *shape)
    return np.asarray(real + 1j * imag)


class _Solved:
    """X and L A^-1 of the machine, from which every slope follows."""

    def __init__(self, machine: TrueMachine, freq_hz: Real, weight: Real) -> None:
        rig = machine.rig(Occasion())
        equations = rig.equations
        self.size, rigid = len(equations.mass), len(equations.rigid)
        self.s: Complex = (2j * np.pi * freq_hz[:, None, None]).astype(np.complex128)
        matrix = np.zeros((freq_hz.size, self.size + rigid, self.size + rigid), np.complex128)
        inner = equations.stiffness + self.s * equations.damping + self.s**2 * equations.mass
        self.loops = [law.stiffness(self.s) for law in rig.laws]
        for stiffness, law in zip(self.loops, rig.laws, strict=True):
            inner = inner + stiffness * np.outer(law.column, law.row)
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
        self.factor = self.s**2 * self.late * weight  # of all values

    def springs(self, springs: Springs) -> Real:
        """Return the columns of log k and log c of each spring in turn."""
        readings = np.moveaxis(self.left[:, :, : self.size] @ springs.rows.T, 2, 0)
        stretches = np.moveaxis(springs.rows @ self.motion[:, : self.size], 1, 0)
        columns = np.empty((len(springs.rows), 2, 2, *self.factor.shape))
        omega = self.s.imag
        for both, reading, stretch, stiffness, damping in zip(
            columns, readings, stretches, springs.stiffness, springs.damping, strict=True
        ):
            slope = reading[:, :, None] * stretch[:, None, :]
            slope *= self.factor
            np.multiply(slope.real, -stiffness, out=both[0, 0])
            np.multiply(slope.imag, -stiffness, out=both[0, 1])
            np.multiply(slope.imag, damping * omega, out=both[1, 0])
            np.multiply(slope.real, -damping * omega, out=both[1, 1])
        return columns.reshape(2 * len(springs.rows), -1).T

    def tolerances(self, slopes: list[Slopes], machine: TrueMachine, tolerance: Tolerances) -> Real:
        """Return the columns of slopes of matrices, and then of the force channels."""
        channels = list(self._force_channels(machine.hammers, tolerance))
        columns = np.empty((len(slopes) + len(channels), 2, *self.factor.shape))
        parts = (
            self._slopes(slopes[first : first + _TOGETHER])
            for first in range(0, len(slopes), _TOGETHER)
        )
        whole = np.empty(self.factor.shape, np.complex128)
        for column, values in zip(columns, chain(*parts, channels), strict=True):
            np.multiply(self.factor, values, out=whole)
            column[0], column[1] = whole.real, whole.imag
        return columns.reshape(len(columns), -1).T

    def _slopes(self, slopes: list[Slopes]) -> Iterator[Complex]:
        """Go through dL X + L A^-1 (dP - dA X) of some parameters; (n_line, n_out, n_in) each."""
        n_line, whole, n_in = self.motion.shape
        pushes = np.zeros((n_line, whole, len(slopes), n_in), np.complex128)
        inside = self.motion[:, : self.size]
        for number, slope in enumerate(slopes):
            if slope.equations is not None:
                pushes[:, :, number] = -self._force(slope.equations)
            for stiffness, by in zip(self.loops, slope.loops, strict=bool(slope.loops)):
                pushes[:, : self.size, number] -= stiffness * (by @ inside)
            if slope.hammers is not None:
                pushes[:, : self.size, number] += slope.hammers
        read = self.left @ pushes.reshape(n_line, whole, -1)
        read = read.reshape(n_line, -1, len(slopes), n_in)
        for number, slope in enumerate(slopes):
            values = read[:, :, number]
            if slope.sensors is not None:
                rows, by = slope.sensors
                values[:, rows] += by @ inside
            yield values

    def _force(self, by: Equations) -> Complex:
        """Return dA X of a parameter; like the motion."""
        inside = self.motion[:, : self.size]
        force = np.zeros(self.motion.shape, np.complex128)
        full = abs(by.stiffness) + abs(by.damping) + abs(by.mass)
        rows, columns = np.flatnonzero(full.any(axis=1)), np.flatnonzero(full.any(axis=0))
        block = np.ix_(rows, columns)  # a few coordinates alone are moved by one parameter
        inner = by.stiffness[block] + self.s * by.damping[block] + self.s**2 * by.mass[block]
        force[:, rows] = inner @ inside[:, columns]
        if by.rigid.any():
            ties = self.scale * by.rigid
            force[:, : self.size] += ties.T @ self.motion[:, self.size :]
            force[:, self.size :] += ties @ inside
        return force

    def _force_channels(
        self, hammers: tuple[Hammer, ...], tolerance: Tolerances
    ) -> Iterator[Complex]:
        """Go through gain and delay of each force channel, those with a tolerance."""
        values = self.sensors @ self.motion[:, : self.size]
        for instrument in dict.fromkeys(hammer.instrument for hammer in hammers):
            is_driven = np.array([hammer.instrument == instrument for hammer in hammers])
            if tolerance.hammer_gain:
                yield tolerance.hammer_gain * values * is_driven
            if tolerance.hammer_delay:
                yield -tolerance.hammer_delay * self.s * values * is_driven


def _sensor_columns(solved: _Solved, station: Station, tolerance: Tolerances, weight: Real) -> Real:
    """J of each sensor on its three rows; (n_sensor, 2 n_value, 9 to 15).

    The columns are gains, angles, position, then cross-talk and delays if they have a tolerance.
    """
    jacobians = []
    motion = solved.s**2 * solved.motion[:, : solved.size]
    for number, (index, sensor) in enumerate(station.sensors()):
        place = slice(None) if sensor.joint else slice(6 * index, 6 * index + 6)
        stage, rows = station.stages[index], slice(3 * number, 3 * number + 3)
        drawn = solved.sensors[rows, place]
        along = np.array([point_row(stage, sensor.position, unit) for unit in sensor.axes])
        if sensor.joint:
            along = drawn / sensor.gain[:, None]
        late = solved.late[:, rows]
        columns = []
        for axis in np.eye(3):
            gain = tolerance.sensor_gain * axis[:, None] * (sensor.gain[:, None] * along)
            turned = np.cross(tolerance.sensor_angle * axis, sensor.axes)
            lever = tolerance.sensor_position * axis
            angle = np.array([point_row(stage, sensor.position, unit) for unit in turned])
            shift = np.array([[0.0, 0.0, 0.0, *np.cross(lever, unit)] for unit in sensor.axes])
            if sensor.joint:  # it has no place
                angle = shift = np.zeros_like(along)
            for row in (gain, sensor.mixing @ angle, sensor.mixing @ shift):
                columns.append(stack_parts(late * (row @ motion[:, place]) * weight[:, rows]))
        for first, second in ((0, 1), (0, 2), (1, 2)) if tolerance.sensor_cross else ():
            row = np.zeros_like(along)
            if not sensor.joint:
                row[first], row[second] = along[second], along[first]
            row *= tolerance.sensor_cross
            columns.append(stack_parts(late * (row @ motion[:, place]) * weight[:, rows]))
        for axis in np.eye(3) if tolerance.sensor_delay else ():
            reading = -solved.s * axis[:, None] * (drawn @ motion[:, place])
            columns.append(stack_parts(tolerance.sensor_delay * late * reading * weight[:, rows]))
        jacobians.append(np.array(columns).T)
    return np.array(jacobians)
