"""Sensors of signals that are read at an instant, such as the measurements of control loops."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from identification.words import (
    Integers,
    PortSum,
    Real,
)
from mbmodel.machine import Machine
from mbmodel.simulation.drives import find_reading
from mbmodel.simulation.integration import rotation_vectors
from mbmodel.simulation.readings import Readings, find_readings
from mbmodel.simulation.time_model import (
    FULL_STATE,
    PROBE_CHANNELS,
    TimeModel,
    add_probes,
    sensor_data_columns,
    sensor_value_columns,
)

_INSTANT_SENSORS = {  # of a probe at an instant, by the number of time derivatives
    0: (mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtSensor.mjSENS_FRAMEQUAT),
    1: (mujoco.mjtSensor.mjSENS_FRAMELINVEL, mujoco.mjtSensor.mjSENS_FRAMEANGVEL),
    2: (mujoco.mjtSensor.mjSENS_FRAMELINACC, mujoco.mjtSensor.mjSENS_FRAMEANGACC),
}
_SIGNAL_PREFIX = "mbw signal"  # of the names of sites and sensors that are added


class InstantSensors(NamedTuple):
    """Sensors for signals that are read at an instant, such as what loops measure.

    Args:
        signals: sums of outputs.
        readings: of the terms of each.
        machine: at rest.
    """

    signals: tuple[PortSum, ...]
    readings: tuple[Readings, ...]
    machine: Machine

    @classmethod
    def of(cls, machine: Machine, signals: Sequence[PortSum]) -> "InstantSensors":
        """Return the sensors of signals.

        Raises:
            UsageError: the machine has no such point.
        """
        ports = [[find_reading(port) for port, _ in signal.terms] for signal in signals]
        return cls(tuple(signals), tuple(find_readings(machine, each) for each in ports), machine)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add the sensors of the probes."""
        for number, (signal, readings) in enumerate(zip(self.signals, self.readings, strict=True)):
            kinds = _INSTANT_SENSORS[signal.derivative]
            add_probes(spec, self.machine, readings.probes, f"{_SIGNAL_PREFIX} {number}", kinds)

    def bind(self, model: TimeModel) -> "BoundSensors":
        """Return the sensors of a model to which they were added."""
        compiled, count = model.compiled, len(self.signals)
        sizes = [compiled.nsensordata, compiled.nq, compiled.nv, compiled.nv]
        weights, turns = np.zeros((count, sum(sizes))), list[tuple[int, Integers, Real]]()
        for number, (signal, readings) in enumerate(zip(self.signals, self.readings, strict=True)):
            row = np.array([weight for _, weight in signal.terms]) @ readings.readout
            for probe in range(len(readings.probes)):
                names = [f"{_SIGNAL_PREFIX} {number} {probe} {part}" for part in range(2)]
                columns = sensor_data_columns(compiled, names)
                part = row[PROBE_CHANNELS * probe : PROBE_CHANNELS * (probe + 1)]
                weights[number, columns[:3]] += part[:3]
                if signal.derivative:
                    weights[number, columns[3:]] += part[3:]
                elif part[3:].any():
                    turns.append((number, columns[3:], part[3:]))
            rest = row[PROBE_CHANNELS * len(readings.probes) :]
            start = sum(sizes[: 1 + signal.derivative])
            for weight, name in zip(rest, readings.encoders, strict=False):
                joint = compiled.joint(name)
                address = joint.dofadr if signal.derivative else joint.qposadr
                weights[number, start + int(address[0])] += weight
            pairs = [(value.sensor, value.number) for value in readings.sensors]
            columns = sensor_value_columns(compiled, pairs)
            weights[number, columns] += rest[len(readings.encoders) :]
        axes = [
            np.array([weight for _, weight in signal.terms]) @ readings.world_axes
            for signal, readings in zip(self.signals, self.readings, strict=True)
        ]
        orders = tuple(signal.derivative for signal in self.signals)
        data = mujoco.MjData(compiled)
        mujoco.mj_setState(compiled, data, model.start, FULL_STATE)
        rest = np.concatenate([model.rest, data.qpos, data.qvel, np.zeros(compiled.nv)])
        return BoundSensors(model, orders, np.reshape(axes, (-1, 3)), weights, tuple(turns), rest)


class BoundSensors(NamedTuple):
    """Signals in MuJoCo's data, relative to rest.

    Args:
        model: the machine at rest.
        orders: number of time derivatives of each; n_signal.
        axes: reading per translation of the whole machine; (n_signal, 3).
        weights: of MuJoCo's sensor data, qpos, qvel and qacc; (n_signal, n).
        turns: signal, columns of a quaternion, and weights of its rotation vector.
        rest: values of what the weights multiply, at rest; (n,).
    """

    model: TimeModel
    orders: tuple[int, ...]
    axes: Real
    weights: Real
    turns: tuple[tuple[int, Integers, Real], ...]
    rest: Real

    def read(self, data: mujoco.MjData) -> Real:
        """Return the signals without the floor's own motion; (n_signal,)."""
        state = np.concatenate([data.sensordata, data.qpos, data.qvel, data.qacc])
        values: Real = self.weights @ (state - self.rest)
        for number, columns, part in self.turns:
            values[number] += part @ rotation_vectors(data.sensordata[columns])
        return values
