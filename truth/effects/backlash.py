"""Play in a joint: its spring does not act within a gap."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.amplitude import peak_stretch
from truth.effects.chance import log_uniform
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import StageDirection, draw_direction
from truth.machine.rig import NonlinearJoint, Occasion, Prepared, Rig
from truth.machine.station import Real

SHARE = (0.01, 0.3)


@dataclass(frozen=True)
class Play:
    """The rest -k clip(x, gap) of a spring k: what it lacks within the gap.

    Args:
        stiffness: k [N/m].
        gap: to either side [m].
    """

    stiffness: float
    gap: float

    def start(self, count: int) -> Real:
        """Nothing is remembered."""
        return np.zeros(count)

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return -k clip(x, gap)."""
        return -self.stiffness * np.minimum(np.maximum(stretch, -self.gap), self.gap), state


@dataclass(frozen=True, kw_only=True)
class Backlash(Sized):
    r"""A dead zone of a joint's spring: force k (x - gap) beyond +gap, k (x + gap) beyond -gap.

    The damper acts all the time; the joint rests in the middle of its gap. It cannot vanish from
    the end of a decaying motion: however small the gap, what is smaller still finds no spring.

    Args:
        spring: the joint's stiffness [N/m or N m/rad].
        peak: stretch under a usual hit, of the linear machine [m or rad].
        size: gap over that.
    """

    direction: StageDirection
    spring: float
    peak: float
    limits = (1e-5, 1.0)

    @property
    def gap(self) -> float:
        """To either side [m or rad]."""
        return self.size * self.peak

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("backlash", self.direction.location, self.direction.dof, {"gap": self.gap})

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the gap in its joint."""
        del occasion
        joint = NonlinearJoint(self.direction.stretch(rig, tested), Play(self.spring, self.gap))
        return replace(rig, joints=(*rig.joints, joint))


def draw_backlash(random: np.random.Generator, scene: Scene, place: str | None) -> Backlash | None:
    """Draw joint, direction and gap."""
    direction = draw_direction(random, scene.station, place)
    size = log_uniform(random, SHARE)
    if direction is None:
        return None
    spring = direction.joint(scene.station).stiffness
    return Backlash(
        direction=direction, spring=spring, peak=peak_stretch(scene, direction), size=size
    )
