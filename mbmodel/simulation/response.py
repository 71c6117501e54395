"""Time response of a machine to signals at its inputs, by MuJoCo, nonlinear joints included.

Outputs of the machine in time: which probes are needed, and how readings follow from them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from identification.words import DERIVATIVE_ORDER, Dof, Input, Quantity, Real, UsageError
from mbmodel.export.linear_response import even_step
from mbmodel.machine import Machine
from mbmodel.simulation.drives import JointDof, Reading, SensorValue, find_drives
from mbmodel.simulation.integration import InputMeans, TimeStep, integrate
from mbmodel.simulation.joint_reach import JointReach
from mbmodel.simulation.time_model import PROBE_CHANNELS, Probe, TimeModel, build_time_model
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
        remarks: sentences on stops that the motion reaches, and on laws that it misses.
    """

    time_s: Real
    outputs: Real
    step: TimeStep
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return the size, the step and its error in one line."""
        return (
            f"response of {self.outputs.shape[1]} outputs at {len(self.time_s)} instants, "
            f"step {self.step.step_s:.3g} s, estimated error {self.step.error:.1g}"
        )


def simulate(
    machine: Machine,
    inputs: Sequence[Input | JointDof],
    outputs: Sequence[Reading],
    time_s: Real,
    signals: Real,
    *,
    quantity: Quantity = "accelerance",
    spin: Mapping[str, float] | None = None,
) -> TimeResponse:
    """Simulate a machine's motion from static equilibrium, without linearising it.

    A cubic spline interpolates the samples of each input. Its mean over each step is applied.
    Integrator and step follow from an error estimate, over a tenth of the time, at most 0.5 s, in
    which the inputs change most.

    Args:
        inputs: points, bodies, motors, joints or the floor [N, N m, unit of control, m/s^2].
        outputs: points, bodies, joints, or MuJoCo sensors of the MJCF.
        time_s: evenly spaced [s]; (n_time,), at least 4.
        signals: of the inputs; (n_time, n_in).
        quantity: receptance gives displacements, mobility velocities, accelerance accelerations;
            joints give positions always, MuJoCo sensors their own values relative to rest.
        spin: rates of the hinges that turn steadily [rad/s], by name.

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
    model = build_time_model(
        machine,
        readings.probes,
        readings.encoders,
        sensors=[(value.sensor, value.number) for value in readings.sensors],
        order=order,
        spin=spin,
    )
    drives = find_drives(model, inputs)
    spline = CubicSpline(time_s - time_s[0], signals)

    def means_of(step_s: float, first: int = 0) -> InputMeans:
        primitive = spline.antiderivative()
        return _spline_means(primitive, step_s, time_s[-1] - time_s[0], first / rate)

    recorder = Recorder(readings.readout, rate, np.zeros(len(outputs)), is_filtered=False)
    duration = time_s[-1] - time_s[0]
    span = min(_ESTIMATED_SHARE * duration, _MAX_ESTIMATED_S)
    gains = drives.gain[None]
    hardest = _fastest_part(signals, round(span * rate))
    step = choose_time_step(model, gains, lambda step_s: means_of(step_s, hardest), recorder, span)
    count = round((duration + 2 / rate) / step.step_s)
    reach = JointReach(model)
    chunks = integrate(model, gains, means_of(step.step_s), count, step, reach=reach)
    motion = recorder.record(chunks, step.step_s)[0, :, : len(time_s)].T
    floor = _floor_motion(spline, drives.floor, time_s - time_s[0], order)
    moved = motion + floor @ _world_axes(model, outputs).T
    return TimeResponse(time_s, moved, step, reach.remarks())


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


def _floor_motion(spline: CubicSpline, floor: Real, time_s: Real, order: int) -> Real:
    """Return the floor's own motion at the instants, in world axes; (n_time, 3)."""
    primitive = spline
    for _ in range(2 - order):
        primitive = primitive.antiderivative()
    moved: Real = primitive(time_s) @ floor.T
    return moved


def _world_axes(model: TimeModel, outputs: Sequence[Reading]) -> Real:
    """Return the reading of each output per translation of the whole machine; (n_out, 3)."""
    rows = np.zeros((len(outputs), 3))
    readings = find_readings(model.machine, outputs)
    probes = len(readings.probes)
    for k in range(probes):
        rows += readings.readout[:, 6 * k : 6 * k + 3]
    return rows


@dataclass(frozen=True, eq=False)
class Readings:
    """Probes and encoders that some outputs need, and the outputs per channel.

    Args:
        probes: a probe for each point or body.
        encoders: names of joints.
        sensors: numbers of MuJoCo sensors.
        readout: outputs per channel of the integration; (n_out, n_channel).
    """

    probes: tuple[Probe, ...]
    encoders: tuple[str, ...]
    sensors: tuple[SensorValue, ...]
    readout: Real


def find_readings(machine: Machine, outputs: Sequence[Reading]) -> Readings:
    """Return what some outputs need.

    Args:
        machine: with its layout.
        outputs: points, bodies (centres of mass, world axes), joints or MuJoCo sensors.

    Raises:
        UsageError: the machine has no such point or body.
    """
    layout = machine.layout
    points = list(dict.fromkeys(dof.point for dof in outputs if isinstance(dof, Dof)))
    joints = list(dict.fromkeys(dof.joint for dof in outputs if isinstance(dof, JointDof)))
    sensors = list(dict.fromkeys(dof for dof in outputs if isinstance(dof, SensorValue)))
    probes = tuple(Probe(layout.body_name(point), _place(machine, point)) for point in points)
    first_joint = PROBE_CHANNELS * len(points)
    first_sensor = first_joint + len(joints)
    readout = np.zeros((len(outputs), first_sensor + len(sensors)))
    for row, dof in zip(readout, outputs, strict=True):
        if isinstance(dof, JointDof):
            row[first_joint + joints.index(dof.joint)] = 1.0
        elif isinstance(dof, SensorValue):
            row[first_sensor + sensors.index(dof)] = 1.0
        else:
            start = PROBE_CHANNELS * points.index(dof.point) + 3 * dof.is_rotation
            row[start : start + 3] = dof.sign * _axes(machine, dof.point)[:, dof.axis % 3]
    return Readings(probes, tuple(joints), tuple(sensors), readout)


def _place(machine: Machine, point: str) -> Real:
    """Return the place of a point or of a body's centre of mass [m]; (3,)."""
    layout = machine.layout
    if point in layout.points:
        place: Real = layout.positions[layout.points.index(point)]
    else:
        place = layout.centres[layout.bodies.index(point)]
    return place


def _axes(machine: Machine, point: str) -> Real:
    """Return the axes of a point in columns; world axes for a body; (3, 3)."""
    layout = machine.layout
    axes: Real = layout.axes[layout.points.index(point)] if point in layout.points else np.eye(3)
    return axes
