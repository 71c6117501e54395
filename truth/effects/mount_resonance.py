"""A sensor on a soft mount: wax, a magnet, a long stud."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import log_uniform
from truth.effects.sensors import AtSensor, draw_at, filter_readings, list_sensors, outputs
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import Complex

REFERENCE_HZ = 100.0
FREQUENCY_HZ = (120.0, 500.0)
DAMPING_RATIO = (0.01, 0.1)
HIGHEST_HZ, LOWEST_HZ = 5000.0, 80.0
LIMITS = ((REFERENCE_HZ / HIGHEST_HZ) ** 2, (REFERENCE_HZ / LOWEST_HZ) ** 2)


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
    limits = LIMITS

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
    frequency = log_uniform(random, FREQUENCY_HZ)
    return MountResonance(
        node=node,
        damping=log_uniform(random, DAMPING_RATIO),
        size=(REFERENCE_HZ / frequency) ** 2,
    )
