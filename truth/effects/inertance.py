"""Mass that acts across a joint: a lever, a screw, or a rotor behind a gear."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import AtDirection, draw_direction, log_uniform
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import GROUND, Joint

RATIO = (0.1, 0.6)
LIMITS = (1e-3, 5.0)


@dataclass(frozen=True)
class Inertance(AtDirection):
    """A force b times the relative acceleration along one joint direction: M gains b g g^T.

    Args:
        size: b over the body's mass (slide) or its moment of inertia about the axis (hinge).
        direction: of the joint, g its row.
        reference: that mass [kg] or moment [kg m2].
    """

    reference: float
    effect = "inertance"
    limits = LIMITS

    def parameters(self) -> dict[str, float]:
        """Return b [kg] or [kg m2]."""
        return {"inertance": self.size * self.reference}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the inertance."""
        row = self.direction.stretch(rig, tested)
        return rig.with_matrices(mass=self.size * self.reference * np.outer(row, row))


def draw_inertance(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Inertance | None:
    """Draw a joint direction between two bodies and the inertance.

    Along the only direction of a body on the floor it is a mass, which is another effect.
    """
    stages = scene.station.stages
    floor = {joint.name for stage in stages if stage.parent == GROUND for joint in stage.joints}

    def between(joint: Joint) -> bool:
        return joint.name not in floor

    direction = draw_direction(random, scene.station, place, between)
    if direction is None:
        return None
    stage = scene.station.stages[scene.station.index(direction.stage)]
    joint = direction.joint(scene.station)
    moment = float(joint.axis @ stage.inertia @ joint.axis)
    return Inertance(
        direction=direction,
        reference=stage.mass if joint.kind == "slide" else moment,
        size=log_uniform(random, RATIO),
    )
