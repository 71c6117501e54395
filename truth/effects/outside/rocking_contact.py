"""A stage that stands on its edges: tilted far enough, a part of its support lets go."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Scene
from truth.effects.joint_laws import JointLaw, peak_stretch
from truth.effects.places import draw_direction, has_spring, log_uniform
from truth.machine.rig import Memoryless
from truth.machine.station import Joint, Real

SHARE = (0.05, 0.4)


@dataclass(frozen=True)
class Rocking(Memoryless):
    """The rest -loss (x - clip(x, edge)): beyond the edge the support is so much softer.

    Args:
        loss: stiffness lost [N m/rad].
        edge: to either side [rad].
    """

    loss: float
    edge: float

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return the moment that is lost."""
        return -self.loss * (
            stretch - np.minimum(np.maximum(stretch, -self.edge), self.edge)
        ), state


@dataclass(frozen=True, kw_only=True)
class RockingContact(JointLaw):
    """A tilting stiffness that falls from k to (1 - size) k beyond an angle.

    Args:
        edge: angle at which a part of the contact lifts [rad].
        size: part of the stiffness that is lost.
    """

    edge: float
    limits = (1e-3, 0.95)
    effect = "unexplained"
    kind = "rocking_contact"

    def parameters(self) -> dict[str, float]:
        """Return the angle [rad] and the part of the stiffness that is lost beyond."""
        return {"edge": self.edge, "lost": self.size}

    def law(self) -> Rocking:
        """Return the moment that is lost beyond the edge."""
        return Rocking(self.size * self.spring, self.edge)


def draw_rocking_contact(
    random: np.random.Generator, scene: Scene, place: str | None
) -> RockingContact | None:
    """Draw joint, direction, angle and what is lost."""

    def tilts(joint: Joint) -> bool:
        return joint.kind == "hinge" and has_spring(joint) and abs(joint.axis[2]) < 0.5

    direction = draw_direction(random, scene.station, place, tilts)
    share, size = log_uniform(random, SHARE), random.uniform(0.1, 0.8)
    if direction is None:
        return None
    spring = direction.joint(scene.station).stiffness
    edge = share * peak_stretch(scene, direction)
    return RockingContact(direction=direction, spring=spring, edge=edge, size=size)
