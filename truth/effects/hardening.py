"""A spring that stiffens: k x + k3 x^3."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.amplitude import peak_stretch
from truth.effects.chance import log_uniform
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import StageDirection, draw_direction
from truth.machine.rig import NonlinearJoint, Occasion, Prepared, Rig
from truth.machine.station import Real

RATIO = (0.05, 1.0)


@dataclass(frozen=True)
class Cubic:
    """The rest k3 x^3, k3 [N/m^3]."""

    stiffness: float

    def start(self, count: int) -> Real:
        """Nothing is remembered."""
        return np.zeros(count)

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return k3 x^3."""
        return self.stiffness * stretch**3, state


@dataclass(frozen=True, kw_only=True)
class Hardening(Sized):
    """A cubic spring (Duffing 1918) beside a joint's linear one.

    Args:
        spring: the joint's stiffness k [N/m or N m/rad].
        peak: stretch under a usual hit, of the linear machine [m or rad].
        size: k3 peak^2 / k, how much stiffer the spring is there.
    """

    direction: StageDirection
    spring: float
    peak: float
    limits = (1e-4, 10.0)

    @property
    def cubic(self) -> float:
        """k3 [N/m^3 or N m/rad^3]."""
        return self.size * self.spring / self.peak**2

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("hardening", self.direction.location, self.direction.dof, {"k3": self.cubic})

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the cubic spring in its joint."""
        del occasion
        joint = NonlinearJoint(self.direction.stretch(rig, tested), Cubic(self.cubic))
        return replace(rig, joints=(*rig.joints, joint))


def draw_hardening(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Hardening | None:
    """Draw joint, direction and how much stiffer it gets."""
    direction = draw_direction(random, scene.station, place)
    size = log_uniform(random, RATIO)
    if direction is None:
        return None
    spring = direction.joint(scene.station).stiffness
    return Hardening(
        direction=direction, spring=spring, peak=peak_stretch(scene, direction), size=size
    )
