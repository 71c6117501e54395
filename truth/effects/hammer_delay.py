"""A force channel that comes late or early against the motion: another filter or amplifier."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.chance import log_uniform, sign
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_hammer
from truth.machine.rig import Filter, Occasion, Prepared, Rig
from truth.machine.station import Complex

DELAY = (6e-5, 3e-4)  # s, beyond the tolerance of 20 microseconds
LIMITS = (1e-6, 5e-3)  # s


@dataclass(frozen=True)
class HammerDelay(Sized):
    """All FRFs times exp(-s tau), tau = ``sign * size``; a force channel that lags has tau < 0.

    Args:
        size: |tau| [s].
        site: first point that is hit.
        sign: of tau.
    """

    site: str
    sign: int
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"delay": self.sign * self.size}
        return Answer("hammer_delay", f"hammer:{self.site}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the delay on all readings."""
        del tested, occasion
        late = partial(_late, self.sign * self.size)
        return replace(rig, filters=(*rig.filters, Filter(tuple(range(len(rig.readout))), late)))


def _late(delay: float, s: Complex) -> Complex:
    return np.asarray(np.exp(-s * delay), np.complex128)


def draw_hammer_delay(
    random: np.random.Generator, scene: Scene, place: str | None
) -> HammerDelay | None:
    """Draw the sign and the delay."""
    site = draw_hammer(random, scene, place)
    if site is None:
        return None
    return HammerDelay(site=site, sign=sign(random), size=log_uniform(random, DELAY))
