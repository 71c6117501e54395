"""A joint that drifts while a machine is tested at several levels: a law that is none."""

from dataclasses import dataclass

import numpy as np

from truth.effects.chance import sign
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_spring_stage
from truth.effects.rows import joint_stretch, springs
from truth.machine.rig import Occasion, Prepared, Rig

LOG_FACTOR = (0.05, 0.3)  # of a joint that warms up or settles during a day of tests
LIMITS = (1e-3, 1.5)


@dataclass(frozen=True)
class LevelDrift(Sized):
    """All springs of a joint times exp(sign size v / (V - 1)) at visit v of V to a level.

    Args:
        size: |log factor| at the last visit.
        stage: name of the child body.
        visits: V, number of visits.
        sign: +1 stiffer, -1 softer.
    """

    stage: str
    visits: int
    sign: int
    limits = LIMITS

    def factor(self, visit: int) -> float:
        """Return the factor at a visit, counted from 0."""
        return float(np.exp(self.sign * self.size * visit / (self.visits - 1)))

    def answer(self) -> Answer:
        """Return what is to be found."""
        factors = {f"factor_{visit + 1}": self.factor(visit) for visit in range(1, self.visits)}
        return Answer("drift", f"joint:{self.stage}", dof="levels", parameters=factors)

    def when(self, occasion: Occasion) -> int:
        """Return the visit, which alone matters."""
        return occasion.visit

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the joint of that visit."""
        index = tested.station.index(self.stage)
        joints = tested.station.stages[index].joints
        more = [(self.factor(occasion.visit) - 1) * joint.stiffness for joint in joints]
        return rig.with_matrices(stiffness=springs(joint_stretch(rig, tested, index), more))


def draw_level_drift(
    random: np.random.Generator, scene: Scene, place: str | None
) -> LevelDrift | None:
    """Draw joint and factor; None for a campaign of one visit."""
    stage = draw_spring_stage(random, scene.station, place)
    visits = 1 + max((occasion.visit for occasion in scene.occasions), default=0)
    if stage is None or visits < 2:
        return None
    return LevelDrift(
        stage=stage, visits=visits, sign=sign(random), size=random.uniform(*LOG_FACTOR)
    )
