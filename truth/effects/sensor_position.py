"""A sensor that sits elsewhere than drawn."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.chance import log_uniform, unit_vector
from truth.effects.effect import Answer, Scene, Vector
from truth.effects.places import draw_sensor
from truth.effects.sensors import with_sensor
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import Sensor

DISTANCE = (0.01, 0.15)
LIMITS = (1e-4, 0.5)  # m


@dataclass(frozen=True)
class SensorPosition(Vector):
    """The true place is the drawn place plus an offset; the hammer hits where it did.

    Args:
        size: length of the offset [m].
        node: of the sensor.
    """

    node: int
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"offset": self.vector}
        return Answer("sensor_position", f"sensor:acc{self.node}", parameters=parameters)

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the sensor at its true place."""
        del occasion

        def change(sensor: Sensor) -> Sensor:
            return replace(sensor, position=sensor.position + np.array(self.vector))

        return with_sensor(tested, self.node, change)


def draw_sensor_position(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorPosition | None:
    """Draw sensor and offset."""
    sensor = draw_sensor(random, scene.station, place)
    if sensor is None:
        return None
    return SensorPosition(
        node=sensor.node, along=unit_vector(random), size=log_uniform(random, DISTANCE)
    )
