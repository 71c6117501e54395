"""A stage that stands on its edges: tilted far enough, a part of its support lets go."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.amplitude import peak_stretch
from truth.effects.chance import log_uniform
from truth.effects.effect import Scene
from truth.effects.outside.unexplained import Unexplained
from truth.effects.places import draw_direction, has_spring
from truth.machine.rig import NonlinearJoint, Occasion, Prepared, Rig
from truth.machine.station import Joint, Real

SHARE = (0.05, 0.4)


@dataclass(frozen=True)
class Rocking:
    """The rest -loss (x - clip(x, edge)): beyond the edge the support is so much softer.

    Args:
        loss: stiffness lost [N m/rad].
        edge: to either side [rad].
    """

    loss: float
    edge: float

    def start(self, count: int) -> Real:
        """Nothing is remembered."""
        return np.zeros(count)

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return the moment that is lost."""
        return -self.loss * (
            stretch - np.minimum(np.maximum(stretch, -self.edge), self.edge)
        ), state


@dataclass(frozen=True, kw_only=True)
class RockingContact(Unexplained):
    """A tilting stiffness that falls from k to (1 - size) k beyond an angle.

    Args:
        direction: of the joint, a rotation.
        spring: its stiffness k [N m/rad].
        edge: angle at which a part of the contact lifts [rad].
        size: part of the stiffness that is lost.
    """

    spring: float
    edge: float
    limits = (1e-3, 0.95)
    kind = "rocking_contact"

    def parameters(self) -> dict[str, float]:
        """Return the angle [rad] and the part of the stiffness that is lost beyond."""
        return {"edge": self.edge, "lost": self.size}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the contact in its joint."""
        del occasion
        law = Rocking(self.size * self.spring, self.edge)
        joint = NonlinearJoint(self.direction.stretch(rig, tested), law)
        return replace(rig, joints=(*rig.joints, joint))


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
