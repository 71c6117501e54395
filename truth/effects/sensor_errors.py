"""Sensors that read something else than their file says, or sit on a soft mount."""

from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from truth.effects.effect import Answer, Scene, Sized, Unsized, Vector
from truth.effects.places import choose, draw_location, log_uniform, sign, unit_vector
from truth.effects.sensors import AtSensor, draw_at, filter_readings, list_sensors, outputs, turn
from truth.machine.rig import Occasion, Prepared, Rig, respond_late
from truth.machine.station import AXES, Complex, Real, Sensor

GAIN_ERROR = (0.1, 0.4)
DELAY = (1e-4, 1e-3)  # s
ANGLE = (0.07, 0.4)  # rad
DISTANCE = (0.01, 0.15)  # m


@dataclass(frozen=True)
class SensorGain(AtSensor, Sized):
    """A reading is ``1 + sign * size`` times what it should be: a wrong sensitivity in the file.

    Args:
        size: |gain - 1|.
        axis: 0, 1, 2 for the sensor's directions.
        sign: +1 reads too much, -1 too little.
    """

    axis: int
    sign: int
    limits = (0.005, 0.9)

    def __post_init__(self) -> None:
        """Check that it is no change of polarity."""
        super().__post_init__()
        self.require(self.gain > 0 and self.axis in range(3))

    @property
    def gain(self) -> float:
        """Return reading over what it should be."""
        return 1 + self.sign * self.size

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("sensor_gain", self.location, f"t{AXES[self.axis]}", {"gain": self.gain})

    def change(self, sensor: Sensor) -> Sensor:
        """Return the sensor with its true gain."""
        return replace(sensor, gain=sensor.gain * _factor_along(self.axis, self.gain))


@dataclass(frozen=True)
class SensorPolarity(AtSensor, Unsized):
    """A reading is -1 times what it should be; there is no half of it.

    Args:
        axis: 0, 1, 2 for the sensor's directions.
    """

    axis: int

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("sensor_polarity", self.location, f"t{AXES[self.axis]}")

    def change(self, sensor: Sensor) -> Sensor:
        """Return the sensor with its true sign."""
        return replace(sensor, gain=sensor.gain * _factor_along(self.axis, -1))


def _factor_along(axis: int, factor: float) -> Real:
    return np.where(np.arange(3) == axis, factor, 1.0)


@dataclass(frozen=True)
class SensorMisalignment(AtSensor, Vector):
    """The true axes are the drawn axes turned by a rotation vector, all three together.

    With the axes as rows A and R the rotation's matrix, ``A_true = A R^T``: each axis d is R d.

    Args:
        size: angle [rad].
    """

    limits = (1e-3, 1.5)

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("sensor_misalignment", self.location, parameters={"rotation": self.vector})

    def change(self, sensor: Sensor) -> Sensor:
        """Return the sensor with its true axes."""
        return replace(sensor, axes=sensor.axes @ turn(self.vector).T)


@dataclass(frozen=True)
class SensorPosition(AtSensor, Vector):
    """The true place is the drawn place plus an offset; the hammer hits where it did.

    Args:
        size: length of the offset [m].
    """

    limits = (1e-4, 0.5)

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("sensor_position", self.location, parameters={"offset": self.vector})

    def change(self, sensor: Sensor) -> Sensor:
        """Return the sensor at its true place."""
        return replace(sensor, position=sensor.position + np.array(self.vector))


@dataclass(frozen=True)
class SensorDelay(AtSensor, Sized):
    """All three readings of a sensor times exp(-s tau): another amplifier, another filter.

    Args:
        size: tau [s].
    """

    limits = (1e-6, 5e-3)

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("sensor_delay", self.location, parameters={"delay": self.size})

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the sensor's delay."""
        rows = outputs(tested.station, self.node)
        return filter_readings(rig, rows, partial(respond_late, self.size))


@dataclass(frozen=True)
class SensorSwap(Unsized):
    """Two cables are exchanged: those of two channels of a sensor, or of two whole sensors.

    What one channel records appears as the other's, with everything its sensor does. Among several
    effects it comes after those of sensors, which belong to the sensor and not to the row of the
    file.

    Args:
        nodes: one sensor, of which two channels are exchanged, or two sensors.
        axes: 0, 1, 2 of the two channels; empty if sensors are exchanged.
    """

    nodes: tuple[int, ...]
    axes: tuple[int, ...] = ()

    def answer(self) -> Answer:
        """Return what is to be found."""
        dof = "+".join(f"t{AXES[axis]}" for axis in self.axes)
        return Answer("sensor_swap", _locate_swap(self.nodes), dof)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with readings and filters exchanged."""
        rows = [outputs(tested.station, node) for node in self.nodes]
        pairs = list(zip(*rows, strict=True))
        if self.axes:
            first, second = (rows[0][axis] for axis in self.axes)
            pairs = [(first, second)]
        order = np.arange(len(rig.readout))
        for first, second in pairs:
            order[[first, second]] = second, first
        # An exchange is its own inverse: row i shows what row order[i] was.
        filters = tuple(
            replace(each, outputs=tuple(int(order[output]) for output in each.outputs))
            for each in rig.filters
        )
        return replace(rig, readout=rig.readout[order], filters=filters)


def _locate_swap(nodes: tuple[int, ...]) -> str:
    return "sensor:" + "+".join(f"acc{node}" for node in nodes)


@draw_at(list_sensors)
def draw_sensor_gain(random: np.random.Generator, scene: Scene, node: int) -> SensorGain:
    """Draw sensor, direction and gain."""
    axis = choose(random, range(3))
    return SensorGain(node=node, axis=axis, sign=sign(random), size=random.uniform(*GAIN_ERROR))


@draw_at(list_sensors)
def draw_sensor_polarity(random: np.random.Generator, scene: Scene, node: int) -> SensorPolarity:
    """Draw sensor and direction."""
    return SensorPolarity(node=node, axis=choose(random, range(3)))


@draw_at(list_sensors)
def draw_sensor_misalignment(
    random: np.random.Generator, scene: Scene, node: int
) -> SensorMisalignment:
    """Draw sensor and rotation."""
    return SensorMisalignment(node=node, along=unit_vector(random), size=random.uniform(*ANGLE))


@draw_at(list_sensors)
def draw_sensor_position(random: np.random.Generator, scene: Scene, node: int) -> SensorPosition:
    """Draw sensor and offset."""
    along = unit_vector(random)
    return SensorPosition(node=node, along=along, size=log_uniform(random, DISTANCE))


@draw_at(list_sensors)
def draw_sensor_delay(random: np.random.Generator, scene: Scene, node: int) -> SensorDelay:
    """Draw sensor and delay."""
    return SensorDelay(node=node, size=log_uniform(random, DELAY))


def draw_sensor_swap(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorSwap | None:
    """Draw one sensor and two channels as often as two sensors."""
    nodes = sorted(list_sensors(scene).values())
    single: list[tuple[int, ...]] = [(node,) for node in nodes]
    double: list[tuple[int, ...]] = list(combinations(nodes, 2))
    kind = choose(random, (single, double or single))
    axes = choose(random, tuple(combinations(range(3), 2)))
    if place is not None:
        kind = single + double
    number = draw_location(random, place, [_locate_swap(swapped) for swapped in kind])
    if number is None:
        return None
    return SensorSwap(nodes=kind[number], axes=axes if len(kind[number]) == 1 else ())


REFERENCE_HZ = 100.0
MOUNT_HZ = (120.0, 500.0)
MOUNT_DAMPING = (0.01, 0.1)
HIGHEST_HZ, LOWEST_HZ = 5000.0, 80.0


@dataclass(frozen=True)
class MountResonance(AtSensor, Sized):
    r"""A sensor's mass on the spring and damper of its mount, too light to be felt by the machine.

        reading / motion = (1 + 2 zeta s / w0) / (1 + 2 zeta s / w0 + s^2 / w0^2)

    in all three directions. Far below w0 the reading is too large by (f / f0)^2.

    Args:
        size: (100 Hz / f0)^2.
        damping: ratio zeta.
    """

    damping: float
    limits = ((REFERENCE_HZ / HIGHEST_HZ) ** 2, (REFERENCE_HZ / LOWEST_HZ) ** 2)

    def __post_init__(self) -> None:
        """Check that the mount is damped."""
        super().__post_init__()
        self.require(self.damping > 0)

    @property
    def frequency(self) -> float:
        """Return f0 [Hz]."""
        return float(REFERENCE_HZ / np.sqrt(self.size))

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"frequency": self.frequency, "damping": self.damping}
        return Answer("mount_resonance", self.location, parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the sensor on its mount."""
        mount = partial(_mount, 2 * np.pi * self.frequency, self.damping)
        return filter_readings(rig, outputs(tested.station, self.node), mount)


def _mount(omega: float, damping: float, s: Complex) -> Complex:
    follows = 1 + 2 * damping * s / omega
    return np.asarray(follows / (follows + (s / omega) ** 2))


@draw_at(list_sensors)
def draw_mount_resonance(random: np.random.Generator, scene: Scene, node: int) -> MountResonance:
    """Draw sensor, frequency and damping."""
    frequency = log_uniform(random, MOUNT_HZ)
    return MountResonance(
        node=node,
        damping=log_uniform(random, MOUNT_DAMPING),
        size=(REFERENCE_HZ / frequency) ** 2,
    )
