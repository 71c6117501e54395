"""One direction of a sensor with its sign reversed."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.chance import choose
from truth.effects.effect import Answer, Scene, Unsized
from truth.effects.places import draw_sensor
from truth.effects.sensors import with_sensor
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import AXES, Sensor


@dataclass(frozen=True)
class SensorPolarity(Unsized):
    """A reading is -1 times what it should be; there is no half of it.

    Args:
        node: of the sensor.
        axis: 0, 1, 2 for its directions.
    """

    node: int
    axis: int

    def answer(self) -> Answer:
        """Return what is to be found."""
        location = f"sensor:acc{self.node}"
        return Answer("sensor_polarity", location=location, dof=f"t{AXES[self.axis]}")

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the sensor's true sign."""
        del occasion
        factors = np.ones(3)
        factors[self.axis] = -1

        def change(sensor: Sensor) -> Sensor:
            return replace(sensor, gain=sensor.gain * factors)

        return with_sensor(tested, self.node, change)


def draw_sensor_polarity(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorPolarity | None:
    """Draw sensor and direction."""
    sensor = draw_sensor(random, scene.station, place)
    if sensor is None:
        return None
    return SensorPolarity(node=sensor.node, axis=choose(random, range(3)))
