r"""Choice of integrator and step by an error estimate: a short span with a step and its half.

Anti-alias filter and decimation: from the steps of the integration to the recorder's rate.

The filter is that of a delta-sigma converter: a symmetric finite impulse response without phase
(Kaiser 1974), sinc times a Kaiser window,

    g(t) = sin(2 pi f_c t) / (pi t) I_0(beta sqrt(1 - (t / W)^2)) / I_0(beta).

It passes up to 0.4 of the recorder's rate and stops from 0.6 on, so that what folds back stays
above 0.4 of the rate. All channels have it alike, so FRFs do not show it. A delay tau of a channel
is exact: its taps are g(t - tau).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import mujoco
import numpy as np

from identification.words import ConvergenceError, Real
from mbmodel.machine import Machine
from mbmodel.model import as_drawn
from mbmodel.nonlinear_joints.friction_solver import has_dry_friction
from mbmodel.simulation.integration import Advance, InputMeans, TimeStep, cause_of_growth, integrate
from mbmodel.simulation.time_model import TimeModel

# Steps per sample of a recorder: at 0.4 of the rate, a force held over a step loses 1.3e-3.
MIN_STEPS_PER_SAMPLE = 20
_MAX_STEPS_PER_SAMPLE = 320
# |lambda| h up to which RK4 is stable is 2.78 on the real axis and 2.83 on the imaginary one.
_MAX_RK4_POLE_TIMES_STEP = 2.0
_MAX_ERROR = 3e-3  # of each channel's rms: accelerometers are calibrated to 1e-2
_MAX_USEFUL_ERROR = 0.1  # of a channel's rms: a larger one is no simulation of this machine
_MIN_SPAN_SAMPLES = 96  # of the recorder, over which the error is estimated
# Of the largest channel's rms: smaller channels, such as those of rigid directions, do not count.
_MIN_CHANNEL_SHARE = 1e-3
# The error of a step's result over its difference to half the step, for orders 2 and 1.
_RICHARDSON_FACTOR, _FIRST_ORDER_FACTOR = 4 / 3, 2.0


def largest_pole(machine: Machine) -> float:
    """Return the largest magnitude of the linear machine's poles [rad/s]."""
    model = as_drawn(machine)
    matrices = model.matrices(model.drawn)
    size = len(matrices.mass)
    dynamics = np.zeros((2 * size, 2 * size))
    dynamics[:size, size:] = np.eye(size)
    dynamics[size:] = -np.linalg.solve(
        matrices.mass, np.hstack([matrices.stiffness, matrices.damping])
    )
    return float(np.abs(np.linalg.eigvals(dynamics)).max())


@dataclass(frozen=True, eq=False)
class Recorder:
    """How readings are taken from the integration's channels.

    Args:
        readout: readings per channel; (n_out, n_channel).
        rate_hz: samples per second [Hz].
        delays_s: of the readings [s]; (n_out,).
        is_filtered: whether an anti-alias filter acts, as in a recorder; else a sample is that
            instant's, from the four steps beside it.
        fewest_steps: of the integration per sample.
    """

    readout: Real
    rate_hz: float
    delays_s: Real
    is_filtered: bool = True
    fewest_steps: int = MIN_STEPS_PER_SAMPLE

    def taps(self, step_s: float) -> Real:
        """Return the taps of every reading; (n_out, n)."""
        if self.is_filtered:
            return filter_taps(self.rate_hz, step_s, self.delays_s)
        # Values of a step are means of its ends, cos(w h / 2) times those in its middle: of fourth
        # order for positions and velocities; accelerations keep an error of (w h)^2 / 12.
        return np.tile([-1 / 8, 5 / 8, 5 / 8, -1 / 8], (len(self.readout), 1))

    def record(self, chunks: Iterable[Real], step_s: float) -> Real:
        """Return the readings at the recorder's rate; (n_record, n_out, n_sample).

        Args:
            chunks: motion in the middle of the steps; (n_record, n_step, n_channel).
            step_s: a whole fraction of the time between samples [s].
        """
        decimator = Decimator(self.taps(step_s), round(1 / (step_s * self.rate_hz)))
        parts = [decimator.push(chunk @ self.readout.T) for chunk in chunks]
        return np.concatenate(parts, axis=2)

    @property
    def lead_s(self) -> float:
        """Time beyond the last sample that a sample needs [s]."""
        return half_width_s(self.rate_hz) + 2 / self.rate_hz


def choose_time_step(
    model: TimeModel,
    gains: Real,
    means_of: Callable[[float], InputMeans],
    recorder: Recorder,
    span_s: float,
    advance_of: Callable[[float], Advance | None] = lambda step_s: None,
) -> TimeStep:
    """Choose integrator and step, with an estimate of the error.

    The step is a whole fraction of the recorder's. It is halved until the recorded readings of a
    short span differ from those with half the step by less than 0.3 % of their rms. The error is
    of second order in the step, since forces are held over a step, so it is 4/3 of the difference.

    Runge and Kutta's method of fourth order is used where it is stable with at most 320 steps per
    sample. For a faster damper MuJoCo's ``implicitfast`` takes its place, which is implicit in
    velocity; for a faster spring ``discrete``, which is implicit in position too and damps all
    modes, the less the shorter its step. Both are of first order: twice the difference. So is any
    integrator with dry friction, which reverses within a step, or with an actuator whose filter is
    exact over a step alone (``filterexact``).

    Args:
        gains: of the inputs; (n_record, n_control, n_in).
        means_of: for a step's length, the mean of the inputs over each step.
        recorder: how the readings are taken.
        span_s: time over which the error is estimated [s].
        advance_of: for a step's length, what takes the steps with control loops closed.

    Raises:
        ConvergenceError: the motion grows without bound with all of them.
    """
    rate_hz = recorder.rate_hz
    fewest = recorder.fewest_steps
    pole = largest_pole(model.machine)
    steps = fewest
    while pole / (steps * rate_hz) > _MAX_RK4_POLE_TIMES_STEP and steps < _MAX_STEPS_PER_SAMPLE:
        steps *= 2
    is_stable = pole / (steps * rate_hz) <= _MAX_RK4_POLE_TIMES_STEP
    beginnings = {"RK4": steps} if is_stable else {"implicitfast": fewest, "discrete": fewest}
    span = max(span_s, _MIN_SPAN_SAMPLES / rate_hz)

    def record(step: TimeStep) -> Real | None:
        try:
            length, advance = step.step_s, advance_of(step.step_s)
            chunks = integrate(
                model, gains, means_of(length), round(span / length), step, advance=advance
            )
            record = recorder.record(chunks, step.step_s)
            if advance is None:
                return record
            further = advance.read_record()[:, : record.shape[2]]
            return np.concatenate([record[:, :, : further.shape[1]], further[None]], axis=1)
        except ConvergenceError:
            return None

    choices: list[TimeStep] = []
    for integrator, beginning in beginnings.items():
        is_second_order = integrator == "RK4" and not (
            has_dry_friction(model.compiled)
            or (model.compiled.actuator_dyntype == mujoco.mjtDyn.mjDYN_FILTEREXACT).any()
        )
        choices.append(
            _halve_step(
                integrator, beginning, rate_hz, record, span, is_second_order=is_second_order
            )
        )
        if choices[-1].error <= _MAX_ERROR:
            break
    best = min(choices, key=lambda choice: choice.error)
    if not np.isfinite(best.error):
        raise ConvergenceError(
            f"{model.machine.source}: the motion grows without bound with steps down to "
            f"{best.step_s:.2g} s: "
            + (
                cause_of_growth(model)
                or "the machine is unstable, the inputs are out of scale, or a motion is too fast "
                f"(up to {pole / (2 * np.pi):.3g} Hz), which is better left rigid"
            )
        )
    if best.error > _MAX_USEFUL_ERROR:
        raise ConvergenceError(
            f"{model.machine.source}: even a step of {best.step_s:.2g} s leaves an estimated error "
            f"of {best.error:.2g} of the motion, since a motion of {pole / (2 * np.pi):.3g} Hz is "
            f"too fast for {rate_hz:g} samples per second: raise --rate, or leave that direction "
            "rigid"
        )
    return best


def _halve_step(
    integrator: str,
    steps: int,
    rate_hz: float,
    record: Callable[[TimeStep], Real | None],
    span_s: float,
    *,
    is_second_order: bool,
) -> TimeStep:
    """Halve a step until the estimated error is small or the step as short as allowed.

    Args:
        integrator: its name.
        steps: per sample, at the beginning.
        record: integrates a short span and returns the readings; None if that fails.
        span_s: the span [s].
        is_second_order: whether the error falls with the square of the step, else in proportion.
    """
    factor = _RICHARDSON_FACTOR if is_second_order else _FIRST_ORDER_FACTOR
    coarse = record(TimeStep(integrator, 1 / (steps * rate_hz)))
    while True:
        fine = record(TimeStep(integrator, 1 / (2 * steps * rate_hz)))
        error = factor * _relative_difference(coarse, fine)
        if error <= _MAX_ERROR or 2 * steps > _MAX_STEPS_PER_SAMPLE:
            return TimeStep(integrator, 1 / (steps * rate_hz), error, span_s)
        coarse, steps = fine, 2 * steps


def _relative_difference(coarse: Real | None, fine: Real | None) -> float:
    """Return the largest relative difference of readings; infinite if an integration failed."""
    if coarse is None or fine is None:
        return float("inf")
    count = min(coarse.shape[2], fine.shape[2])
    difference = coarse[:, :, :count] - fine[:, :, :count]
    size = np.sqrt((fine**2).mean(axis=(0, 2)))
    rms = np.sqrt((difference**2).mean(axis=(0, 2)))
    counts = size > _MIN_CHANNEL_SHARE * size.max(initial=0.0)
    return float((rms[counts] / size[counts]).max(initial=0.0))


PASS_SHARE, STOP_SHARE = 0.4, 0.6  # of the recorder's rate
_STOP_DB = 100.0  # below what a good converter resolves
# Kaiser's formulas for this attenuation A: beta = 0.1102 (A - 8.7), and the filter's length is
# (A - 8) / 14.36 over the width of the transition [Hz].
_KAISER_BETA = 0.1102 * (_STOP_DB - 8.7)
_LENGTH_TIMES_WIDTH = (_STOP_DB - 8.0) / 14.36


def half_width_s(rate_hz: float) -> float:
    """Return W, half the length of the filter [s].

    Args:
        rate_hz: of the recorder [Hz].
    """
    return _LENGTH_TIMES_WIDTH / ((STOP_SHARE - PASS_SHARE) * rate_hz) / 2


def filter_taps(rate_hz: float, step_s: float, delays_s: Real) -> Real:
    """Return the taps of every channel, for values in the middle of the steps.

    Args:
        rate_hz: of the recorder [Hz].
        step_s: of the integration [s].
        delays_s: of the channels [s]; (n_channel,).

    Returns:
        Taps whose sum is 1; (n_channel, 2 m), the first for the value m steps before the sample.
    """
    width = half_width_s(rate_hz)
    count = int(np.ceil(width / step_s)) + 1
    time = (count - np.arange(2 * count) - 0.5) * step_s - np.asarray(delays_s)[:, None]
    cut = 0.5 * (PASS_SHARE + STOP_SHARE) * rate_hz
    inside = np.clip(1 - (time / width) ** 2, 0.0, None)
    window = np.where(inside > 0, np.i0(_KAISER_BETA * np.sqrt(inside)), 0.0)
    taps = np.sinc(2 * cut * time) * window
    return taps / taps.sum(axis=1, keepdims=True)


@dataclass
class Decimator:
    """Filter that takes chunks of a signal and gives the recorder's samples as they come.

    Sample j is at the time j times factor times step. Before the first step all channels are zero.

    Args:
        taps: of the channels; (n_channel, 2 m).
        factor: steps of the integration per sample.
        kept: values that later samples still need; (n_record, n_channel, n).
        skipped: further values that no sample needs.
    """

    taps: Real
    factor: int
    kept: Real | None = field(default=None)
    skipped: int = 0

    def push(self, chunk: Real) -> Real:
        """Return the samples that a chunk completes.

        Args:
            chunk: next values in the middle of the steps; (n_record, n, n_channel).

        Returns:
            (n_record, n_channel, n_sample).
        """
        count = self.taps.shape[1]
        values = np.ascontiguousarray(np.moveaxis(chunk, 1, 2))
        if self.kept is None:
            self.kept = np.zeros((*values.shape[:2], count // 2))
        dropped = min(self.skipped, values.shape[2])
        self.skipped -= dropped
        values = np.concatenate([self.kept, values[:, :, dropped:]], axis=2)
        number = max(0, (values.shape[2] - count) // self.factor + 1)
        windows = np.lib.stride_tricks.sliding_window_view(values, min(count, values.shape[2]), 2)
        chosen = windows[:, :, : number * self.factor : self.factor][:, :, :number]
        self.kept = values[:, :, number * self.factor :].copy()
        self.skipped += max(0, number * self.factor - values.shape[2])
        if not number:
            return np.zeros((*values.shape[:2], 0))
        return np.einsum("rcjl,cl->rcj", chosen, self.taps)
