"""One direction of a sensor whose sensitivity is not what the file says."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.chance import choose, sign
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_sensor
from truth.effects.sensors import with_sensor
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import AXES, Sensor

ERROR = (0.1, 0.4)
LIMITS = (0.005, 0.9)


@dataclass(frozen=True)
class SensorGain(Sized):
    """A reading is ``1 + sign * size`` times what it should be.

    Args:
        size: |gain - 1|.
        node: of the sensor.
        axis: 0, 1, 2 for its directions.
        sign: +1 reads too much, -1 too little.
    """

    node: int
    axis: int
    sign: int
    limits = LIMITS

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
        return Answer(
            "sensor_gain",
            location=f"sensor:acc{self.node}",
            dof=f"t{AXES[self.axis]}",
            parameters={"gain": self.gain},
        )

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the sensor's true gain."""
        del occasion
        factors = np.ones(3)
        factors[self.axis] = self.gain

        def change(sensor: Sensor) -> Sensor:
            return replace(sensor, gain=sensor.gain * factors)

        return with_sensor(tested, self.node, change)


def draw_sensor_gain(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorGain | None:
    """Draw sensor, direction and gain."""
    sensor = draw_sensor(random, scene.station, place)
    if sensor is None:
        return None
    return SensorGain(
        node=sensor.node,
        axis=choose(random, range(3)),
        sign=sign(random),
        size=random.uniform(*ERROR),
    )
