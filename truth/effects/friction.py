"""Dry friction beside a spring: it sticks as a spring does, and slides at a force."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.amplitude import peak_stretch
from truth.effects.chance import log_uniform
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import StageDirection, draw_direction
from truth.machine.rig import NonlinearJoint, Occasion, Prepared, Rig
from truth.machine.station import Real

RATIO = (0.05, 0.5)
SHARE = (0.05, 0.6)


@dataclass(frozen=True)
class Jenkins:
    """The rest -k y of k (x - y), |k (x - y)| <= limit: y, the slip, follows when that is reached.

    Args:
        stiffness: k [N/m].
        limit: [N].
    """

    stiffness: float
    limit: float

    def start(self, count: int) -> Real:
        """No slip yet."""
        return np.zeros(count)

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return -k y and y."""
        reach = self.limit / self.stiffness
        slip = stretch - np.minimum(np.maximum(stretch - state, -reach), reach)
        return -self.stiffness * slip, slip


@dataclass(frozen=True, kw_only=True)
class Friction(Sized):
    r"""A Jenkins element in parallel to a joint's spring.

    Its force is k (x - y) while that is within its limit; beyond, y slides along (Jenkins 1962).
    At small motion it is the spring k, which belongs to the linear machine.

    Args:
        spring: the joint's own stiffness [N/m or N m/rad].
        size: k over the joint's own stiffness.
        limit: [N or N m].
    """

    direction: StageDirection
    spring: float
    limit: float
    limits = (1e-3, 5.0)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"k": self.size * self.spring, "limit": self.limit}
        return Answer("friction", self.direction.location, self.direction.dof, parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the stuck spring, and what slides beside it."""
        del occasion
        row, stiffness = self.direction.stretch(rig, tested), self.size * self.spring
        stuck = rig.with_matrices(stiffness=stiffness * np.outer(row, row))
        joint = NonlinearJoint(row, Jenkins(stiffness, self.limit))
        return replace(stuck, joints=(*rig.joints, joint))


def draw_friction(random: np.random.Generator, scene: Scene, place: str | None) -> Friction | None:
    """Draw joint, direction and limit: a part of the force that the stuck spring would carry."""
    direction = draw_direction(random, scene.station, place)
    size, share = log_uniform(random, RATIO), log_uniform(random, SHARE)
    if direction is None:
        return None
    spring = direction.joint(scene.station).stiffness
    limit = share * size * spring * peak_stretch(scene, direction)
    return Friction(direction=direction, spring=spring, size=size, limit=limit)
