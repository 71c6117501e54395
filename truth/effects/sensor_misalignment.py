"""A sensor glued on askew."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.chance import unit_vector
from truth.effects.effect import Answer, Scene, Vector
from truth.effects.places import draw_sensor
from truth.effects.sensors import turn, with_sensor
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import Sensor

ANGLE = (0.07, 0.4)
LIMITS = (1e-3, 1.5)  # rad


@dataclass(frozen=True)
class SensorMisalignment(Vector):
    """The true axes are the drawn axes turned by a rotation vector, all three together.

    With the axes as rows A and R the rotation's matrix, ``A_true = A R^T``: each axis d is R d.

    Args:
        size: angle [rad].
        node: of the sensor.
    """

    node: int
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"rotation": self.vector}
        return Answer("sensor_misalignment", f"sensor:acc{self.node}", parameters=parameters)

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the sensor's true axes."""
        del occasion

        def change(sensor: Sensor) -> Sensor:
            return replace(sensor, axes=sensor.axes @ turn(self.vector).T)

        return with_sensor(tested, self.node, change)


def draw_sensor_misalignment(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorMisalignment | None:
    """Draw sensor and rotation."""
    sensor = draw_sensor(random, scene.station, place)
    if sensor is None:
        return None
    return SensorMisalignment(
        node=sensor.node, along=unit_vector(random), size=random.uniform(*ANGLE)
    )
