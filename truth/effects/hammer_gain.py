"""A force channel that is wrong by a factor: a wrong calibration value of the hammer."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.chance import sign
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_hammer
from truth.machine.rig import Filter, Occasion, Prepared, Rig
from truth.machine.station import Complex

TOO_MUCH, TOO_LITTLE = (0.06, 0.2), (0.06, 0.15)  # |gain - 1|, beyond the tolerance of 2 %
LIMITS = (0.005, 0.9)


@dataclass(frozen=True)
class HammerGain(Sized):
    """All FRFs are ``1 + sign * size`` times what they should be: one hammer hits everywhere.

    Args:
        size: |gain - 1|.
        site: first point that is hit.
        sign: +1 for FRFs that are too large, -1 for too small ones.
    """

    site: str
    sign: int
    limits = LIMITS

    @property
    def gain(self) -> float:
        """Return the FRFs over what they should be."""
        return 1 + self.sign * self.size

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("hammer_gain", f"hammer:{self.site}", parameters={"gain": self.gain})

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the factor on all readings."""
        del tested, occasion
        whole = Filter(tuple(range(len(rig.readout))), partial(_factor, self.gain))
        return replace(rig, filters=(*rig.filters, whole))


def _factor(gain: float, s: Complex) -> Complex:
    return np.full(s.shape, gain, np.complex128)


def draw_hammer_gain(
    random: np.random.Generator, scene: Scene, place: str | None
) -> HammerGain | None:
    """Draw the sign and the size."""
    site = draw_hammer(random, scene, place)
    if site is None:
        return None
    towards = sign(random)
    size = random.uniform(*(TOO_MUCH if towards > 0 else TOO_LITTLE))
    return HammerGain(site=site, sign=towards, size=size)
