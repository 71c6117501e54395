r"""Control loops that are closed in time: controllers at their samples, and what they record.

At the instants k T a sampled controller reads y, relative to rest, with the noise n and the
reference r, and puts out

    e = q(y + n) - r,    u = -(C x + D e),    x <- A x + B e,

with q the rounding to the encoder's resolution. A measurement that follows the control at once is
read before the control changes. u is rounded to the quantisation of the output, reaches the machine
at k T + tau and is held for T. A command is added to it, and the limit holds for the sum. The
states know nothing of the limit: an integrator winds up.

A continuous controller is stepped with the machine: exactly for straight lines of e between steps
(first-order hold), its output over a step being that of the straight line through the last two, at
the middle of the step less tau. Its error is of second order in the step, as that of the inputs.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from identification.words import (
    ConvergenceError,
    Integers,
    Loop,
    Real,
    sampling_period,
)
from mbmodel.simulation.drives import CONTROL_SPEC
from mbmodel.simulation.instant_sensors import BoundSensors
from mbmodel.simulation.integration import InputMeans
from mbmodel.simulation.loop_signals import (
    PERIOD_ROUNDING,
    LoopDrives,
    LoopRecord,
    mask_position_loops,
)
from mbmodel.simulation.time_model import (
    FULL_STATE,
)

_MAX_CONTROL = 1e10  # beyond it MuJoCo sets all controls to zero


class SignalSplines(NamedTuple):
    """The inputs of a simulation as functions of time.

    Args:
        spline: of their samples.
        end_s: of the spline [s].
        start_s: time in the spline at which the simulation begins [s].
        floor: acceleration of the floor per unit of each input; (3, n_in).
        means: mean of the inputs over the steps.
    """

    spline: CubicSpline
    end_s: float
    start_s: float
    floor: Real
    means: InputMeans


def floor_motion(spline: CubicSpline, floor: Real, time_s: Real, order: int) -> Real:
    """Return the floor's own motion at the instants, in world axes; (n_time, 3)."""
    primitive = spline
    for _ in range(2 - order):
        primitive = primitive.antiderivative()
    return primitive(time_s) @ floor.T


class ClosedLoopSteps:
    """Steps of a machine with its loops closed: an ``Advance`` of the integration.

    Args:
        sensors: of what the loops measure, then of further signals that are recorded.
        loops: closed loops; none to record signals alone.
        drives: how they drive the machine.
        signals: inputs of the simulation.
        step_s: of the integration [s].
        rate_hz: of the record [Hz].
        is_ideal: leave out the rounding of encoders and controls, beside which half a step would
            change more than the integration does.
    """

    def __init__(
        self,
        sensors: BoundSensors,
        loops: Sequence[Loop],
        drives: LoopDrives,
        signals: SignalSplines,
        step_s: float,
        rate_hz: float,
        *,
        is_ideal: bool = False,
    ) -> None:
        """Begin at rest."""
        self._sensors, self._drives, self._signals, self._step_s = sensors, drives, signals, step_s
        self._compiled, self._loops, count = sensors.model.compiled, tuple(loops), len(loops)
        self._data: mujoco.MjData | None = None
        period = sampling_period(loops) or step_s
        self._steps_per_sample = round(period / step_s) if loops else 0
        self._steps_per_record = round(1 / (step_s * rate_hz))
        begin = signals.spline(signals.start_s) @ drives.reference
        # a span in the middle begins at rest, whatever it reads
        self._origin = np.where(mask_position_loops(loops) | (signals.start_s > 0), begin, 0.0)
        matrices = [_matrices(loop, step_s) for loop in loops]
        self._a, self._b, self._c, self._d = (
            block_diag(*[each[k] for each in matrices]) if loops else np.zeros((0, 0))
            for k in range(4)
        )
        self._states = np.zeros(len(self._a))
        taps = [_taps(loop, step_s, self._steps_per_sample) for loop in loops]
        shape = (max(1, self._steps_per_sample), 2, count)
        self._ages = np.stack([ages for ages, _ in taps], -1) if taps else np.zeros(shape, int)
        self._shares = np.stack([share for _, share in taps], -1) if taps else np.zeros(shape)
        self._controls = np.zeros((int(self._ages.max(initial=0)) + 1, count))
        self._limits = np.array([np.inf if loop.limit is None else loop.limit for loop in loops])
        is_stepped = 0.0 if is_ideal else 1.0
        self._resolution = np.array([is_stepped * loop.resolution for loop in loops])
        self._quantisation = np.array([is_stepped * loop.quantisation for loop in loops])
        self._index, self._newest = 0, 0
        self._log: list[tuple[Real, ...]] = []

    @np.errstate(over="ignore", invalid="ignore")  # a motion without bound is refused by name
    def __call__(self, state: Real, control: Real) -> tuple[Real, Real]:
        """Take steps from a state with the controls of all but the loops; one record."""
        compiled, count = self._compiled, control.shape[1]
        if self._data is None:
            self._data = mujoco.MjData(compiled)
            mujoco.mj_setState(compiled, self._data, state[0], FULL_STATE)
            mujoco.mj_setState(compiled, self._data, control[0, 0], CONTROL_SPEC)
        data = self._data
        states = np.empty((1, count, state.shape[1]))
        sensors = np.empty((1, count, compiled.nsensordata))
        row_state = np.empty(state.shape[1])
        references, noise, floor = self._sample_signals(count)
        played = self._signals.means(self._index, self._index + count)[0] @ self._drives.command
        for row in range(count):
            place = self._index % max(1, self._steps_per_sample)
            is_sample = bool(self._loops) and place == 0
            is_recorded = self._index % self._steps_per_record == 0
            if is_sample or is_recorded:
                mujoco.mj_forward(compiled, data)
                read = self._sensors.read(data) + floor[row]
            if is_sample:
                self._sample(read[: len(self._loops)] + noise[row], references[row])
            ages = (self._newest - self._ages[place]) % len(self._controls)
            held = (self._shares[place] * self._controls[ages, np.arange(ages.shape[1])]).sum(
                axis=0
            )
            limited = np.clip(held + played[row], -self._limits, self._limits)
            if is_recorded:
                self._log.append((references[row], read, limited))
            applied = control[0, row] + self._drives.gain @ limited
            if not np.abs(limited).max(initial=0.0) < _MAX_CONTROL:
                raise ConvergenceError(
                    f"{self._sensors.model.machine.source}: the controls grow without bound within "
                    f"{self._index * self._step_s:.3g} s: make the loops stable, or state a limit"
                )
            mujoco.mj_setState(compiled, data, applied, CONTROL_SPEC)
            mujoco.mj_step(compiled, data)
            sensors[0, row] = data.sensordata
            mujoco.mj_getState(compiled, data, row_state, FULL_STATE)
            states[0, row] = row_state
            self._index += 1
        return states, sensors

    def records(self, time_s: Real) -> tuple[tuple[LoopRecord, ...], Real]:
        """Return what the loops did at the instants of the record, and the further signals.

        Args:
            time_s: of the record [s]; (n_time,).

        Returns:
            The loops, and the signals; (n_time, n_signal).
        """
        columns = zip(*self._log[: len(time_s)], strict=True)
        reference, read, control = (np.array(column) for column in columns)
        origin = self._origin
        records = [
            LoopRecord(
                loop, time_s, reference[:, k] + origin[k], read[:, k] + origin[k], control[:, k]
            )
            for k, loop in enumerate(self._loops)
        ]
        return tuple(records), read[:, len(records) :]

    def read_record(self) -> Real:
        """Return the signals that are read at the instants of the record; (n_signal, n_time)."""
        return np.array([read for _, read, _ in self._log]).T

    def _sample_signals(self, count: int) -> tuple[Real, Real, Real]:
        """Return references, noise and the floor's share of the signals at the next steps."""
        signals, drives = self._signals, self._drives
        time_s = signals.start_s + (self._index + np.arange(count)) * self._step_s
        inside = np.minimum(time_s, signals.end_s)
        values = signals.spline(inside)
        read = self._sensors
        floor = np.zeros((count, len(read.orders)))
        for order in set(read.orders) if signals.floor.any() else ():
            is_read = [each == order for each in read.orders]
            moved = floor_motion(signals.spline, signals.floor, inside, order)
            floor += np.where(is_read, moved @ read.axes.T, 0.0)
        return values @ drives.reference - self._origin, values @ drives.noise, floor

    def _sample(self, measured: Real, reference: Real) -> None:
        """Let the controllers read, and put out their next control."""
        error = _round_to_steps(measured, self._resolution) - reference
        control = _round_to_steps(-(self._c @ self._states + self._d @ error), self._quantisation)
        self._states = self._a @ self._states + self._b @ error
        self._newest = (self._newest + 1) % len(self._controls)
        self._controls[self._newest] = control


def _round_to_steps(values: Real, steps: Real) -> Real:
    """Return values as multiples of steps; unchanged where a step is 0."""
    if not steps.any():
        return values
    size = np.where(steps > 0, steps, 1.0)
    return np.where(steps > 0, size * np.round(values / size), values)


def _matrices(loop: Loop, step_s: float) -> tuple[Real, Real, Real, Real]:
    """Return A, B, C, D of a controller per sample, or per step of a continuous one."""
    controller = loop.controller
    matrices = (
        controller.dynamics,
        controller.input_matrix,
        controller.output_matrix,
        controller.feedthrough,
    )
    if controller.period_s or not len(controller.dynamics):
        return matrices
    from scipy.signal import cont2discrete  # noqa: PLC0415  # slow to load

    a, b, c, d, _ = cont2discrete(matrices, step_s, "foh")
    return a, b, c, d


def _taps(loop: Loop, step_s: float, steps: int) -> tuple[Integers, Real]:
    """Return which two controls act over each step of a period, and with which share.

    Returns:
        Their ages in samples, 0 for the newest, and their shares; (n_step, 2) each.
    """
    if not loop.controller.period_s:
        place = 0.5 - loop.delay / step_s  # of the middle of the step, the newest sample being 0
        before = min(int(np.floor(place)), -1)
        return np.array([[-before, -before - 1]]), np.array(
            [[1 - (place - before), place - before]]
        )
    period = loop.controller.period_s
    whole = int(loop.delay / period + PERIOD_ROUNDING)
    rest = max(loop.delay - whole * period, 0.0)
    share = np.clip((np.arange(steps) + 1) - rest / step_s, 0.0, 1.0)
    ages = np.tile([whole + 1, whole], (steps, 1))
    return ages, np.column_stack([1 - share, share])
