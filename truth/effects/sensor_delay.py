"""A sensor whose readings come late: another amplifier, another filter."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from truth.effects.chance import log_uniform
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_sensor
from truth.effects.sensors import filter_readings
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import Complex

DELAY = (1e-4, 1e-3)
LIMITS = (1e-6, 5e-3)  # s


@dataclass(frozen=True)
class SensorDelay(Sized):
    """All three readings of a sensor times exp(-s tau).

    Args:
        size: tau [s].
        node: of the sensor.
    """

    node: int
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"delay": self.size}
        return Answer("sensor_delay", f"sensor:acc{self.node}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the sensor's delay."""
        del occasion
        return filter_readings(rig, tested, self.node, partial(_late, self.size))


def _late(delay: float, s: Complex) -> Complex:
    return np.asarray(np.exp(-s * delay))


def draw_sensor_delay(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorDelay | None:
    """Draw sensor and delay."""
    sensor = draw_sensor(random, scene.station, place)
    if sensor is None:
        return None
    return SensorDelay(node=sensor.node, size=log_uniform(random, DELAY))
