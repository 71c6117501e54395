"""Time response of a machine to signals at its inputs, by MuJoCo, nonlinear joints included."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from identification.words import DERIVATIVE_ORDER, Loop, PortSum, Quantity, Real, UsageError
from mbmodel.export.linear_response import even_step
from mbmodel.machine import Machine
from mbmodel.simulation.closed_loops import ClosedLoopSteps, SignalSplines, floor_motion
from mbmodel.simulation.drives import Drive, Reading, find_drives
from mbmodel.simulation.instant_sensors import InstantSensors
from mbmodel.simulation.integration import InputMeans, TimeStep, integrate
from mbmodel.simulation.joint_reach import JointReach
from mbmodel.simulation.loop_signals import (
    LoopRecord,
    drive_loops,
    reference_remarks,
    samples_per_period,
    steps_per_sample,
)
from mbmodel.simulation.readings import find_readings
from mbmodel.simulation.time_model import build_time_model
from mbmodel.simulation.time_step import Recorder, choose_time_step

_ESTIMATED_SHARE = 0.1  # of the signals, over which the error of the step is estimated
_MAX_ESTIMATED_S = 0.5  # s: longer spans cost more than they tell


@dataclass(frozen=True, eq=False)
class TimeResponse:
    """Response of a machine in time.

    Args:
        time_s: instants [s]; (n_time,).
        outputs: motion relative to rest, in the order of the labels [m, m/s or m/s^2, rad for
            rotations; positions for joints]; (n_time, n_out).
        step: integrator and step with the estimated error.
        remarks: sentences on stops that the motion reaches, on laws that it misses, and on
            references that do not begin at 0.
        loops: reference, measurement and control of each closed loop.
        watched: further signals, without rounding; None without any; (n_time, n_signal).
    """

    time_s: Real
    outputs: Real
    step: TimeStep
    remarks: tuple[str, ...] = ()
    loops: tuple[LoopRecord, ...] = ()
    watched: Real | None = None

    def __repr__(self) -> str:
        """Return the size, the step and its error in one line."""
        return (
            f"response of {self.outputs.shape[1]} outputs at {len(self.time_s)} instants, "
            f"step {self.step.step_s:.3g} s, estimated error {self.step.error:.1g}"
        )


def simulate(  # noqa: PLR0913  # one for each thing that a simulation needs
    machine: Machine,
    inputs: Sequence[Drive],
    outputs: Sequence[Reading],
    time_s: Real,
    signals: Real,
    *,
    quantity: Quantity = "accelerance",
    spin: Mapping[str, float] | None = None,
    loops: Sequence[Loop] = (),
    watched: Sequence[PortSum] = (),
) -> TimeResponse:
    """Simulate a machine's motion from static equilibrium, without linearising it.

    A cubic spline interpolates the samples of each input. Its mean over each step is applied.
    Integrator and step follow from an error estimate, over a tenth of the time, at most 0.5 s, in
    which the inputs change most.

    Args:
        inputs: points, bodies, motors, joints or the floor [N, N m, unit of control, m/s^2], and
            references and noise of loops in the unit of what these measure.
        outputs: points, bodies, joints, or MuJoCo sensors of the MJCF.
        time_s: evenly spaced [s]; (n_time,), at least 4.
        signals: of the inputs; (n_time, n_in).
        quantity: receptance gives displacements, mobility velocities, accelerance accelerations;
            joints give positions always, MuJoCo sensors their own values relative to rest.
        spin: rates of the hinges that turn steadily [rad/s], by name.
        loops: control loops that are closed, all continuous or of one sampling period. Samples of
            the signals must then divide the period.
        watched: further signals to be recorded, such as the errors of a budget.

    Raises:
        UsageError: an uneven time axis, shapes that do not fit, or an unknown label.
        ConvergenceError: the motion grows without bound.
    """
    time_s, signals = np.asarray(time_s, float), np.asarray(signals, float)
    rate = 1 / even_step(time_s)
    if signals.shape != (len(time_s), len(inputs)) or not np.isfinite(signals).all():
        raise UsageError(
            f"signals have shape {signals.shape}: give finite numbers of shape ({len(time_s)}, "
            f"{len(inputs)}), one row per sample and one column per input"
        )
    readings = find_readings(machine, outputs)
    order = DERIVATIVE_ORDER[quantity]
    signals_read = [*(loop.measured for loop in loops), *watched]
    sensors = InstantSensors.of(machine, signals_read)
    model = build_time_model(
        machine,
        readings.probes,
        readings.encoders,
        sensors=[(value.sensor, value.number) for value in readings.sensors],
        order=order,
        spin=spin,
        change=sensors.add_to,
    )
    drives = find_drives(model, inputs)
    spline = CubicSpline(time_s - time_s[0], signals)
    duration = time_s[-1] - time_s[0]
    control = drive_loops(model, loops, inputs)
    gains = drives.gain[None]
    samples_per_period(loops, rate)

    def means_of(step_s: float, first: int = 0) -> InputMeans:
        return _spline_means(spline.antiderivative(), step_s, duration, first / rate)

    def closed_of(
        step_s: float, first: int = 0, *, is_ideal: bool = False
    ) -> ClosedLoopSteps | None:
        if not signals_read:
            return None
        splines = SignalSplines(
            spline, duration, first / rate, drives.floor, means_of(step_s, first)
        )
        return ClosedLoopSteps(
            sensors.bind(model), loops, control, splines, step_s, rate, is_ideal=is_ideal
        )

    recorder = Recorder(
        readings.readout,
        rate,
        np.zeros(len(outputs)),
        is_filtered=False,
        fewest_steps=steps_per_sample(loops, rate),
    )
    span = min(_ESTIMATED_SHARE * duration, _MAX_ESTIMATED_S)
    hardest = _fastest_part(signals, round(span * rate))
    step = choose_time_step(
        model,
        gains,
        lambda step_s: means_of(step_s, hardest),
        recorder,
        span,
        lambda step_s: closed_of(step_s, hardest, is_ideal=True),
    )
    count = round((duration + 2 / rate) / step.step_s)
    reach, closed = JointReach(model), closed_of(step.step_s)
    chunks = integrate(
        model, gains, means_of(step.step_s), count, step, reach=reach, advance=closed
    )
    motion = recorder.record(chunks, step.step_s)[0, :, : len(time_s)].T
    floor = floor_motion(spline, drives.floor, time_s - time_s[0], order)
    moved = motion + floor @ readings.world_axes.T
    records, seen = ((), None) if closed is None else closed.records(time_s)
    remarks = reference_remarks(loops, control.reference.T @ signals[0])
    return TimeResponse(time_s, moved, step, (*reach.remarks(), *remarks), records, seen)


def _fastest_part(signals: Real, length: int) -> int:
    """Return the first sample of the part in which the inputs change most; it begins at rest."""
    size = np.maximum(np.abs(signals).max(axis=0), np.finfo(float).tiny)
    changes = (np.diff(signals / size, axis=0) ** 2).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(changes)])
    length = min(max(length, 1), len(changes))
    return int(np.argmax(total[length:] - total[:-length]))


def _spline_means(primitive: PPoly, step_s: float, end_s: float, start_s: float) -> InputMeans:
    """Return the means of a spline over the steps; behind its end the inputs keep their values.

    Args:
        primitive: of the spline.
        end_s: of the spline [s].
        start_s: time in the spline at which the first step begins [s].
    """
    last = primitive(end_s, 1)

    def means(start: int, stop: int) -> Real:
        edges = start_s + np.arange(start, stop + 1) * step_s
        inside = np.minimum(edges, end_s)
        impulse = primitive(inside) + (edges - inside)[:, None] * last
        over_step: Real = np.diff(impulse, axis=0) / step_s
        return over_step[None]

    return means
