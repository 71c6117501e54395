"""A joint that is stiffer or softer in one test: the machine warmed up, a bolt was tightened."""

from dataclasses import dataclass

import numpy as np

from truth.effects.chance import choose, sign
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_spring_stage, hammer_site
from truth.effects.rows import joint_stretch, springs
from truth.machine.rig import Occasion, Prepared, Rig

LOG_FACTOR = (0.1, 0.5)
LIMITS = (1e-3, 1.5)


@dataclass(frozen=True)
class Drift(Sized):
    """All springs of a joint times a factor exp(sign size), in one test or one set-up.

    Args:
        size: |log factor|.
        stage: name of the child body.
        test: label of a reference, such as ``acc11:+ty``, or name of a set-up.
        site: of the reference as the drawing has it, ``hit29`` for ``acc29``; empty of a set-up.
        sign: +1 stiffer, -1 softer.
    """

    stage: str
    test: str
    sign: int
    site: str = ""
    limits = LIMITS

    @property
    def factor(self) -> float:
        """Return the factor."""
        return float(np.exp(self.sign * self.size))

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"factor": self.factor}
        dof = f"{self.site}:{self.test.partition(':')[2]}" if self.site else self.test
        return Answer("drift", f"joint:{self.stage}", dof=dof, parameters=parameters)

    def when(self, occasion: Occasion) -> bool:
        """Tell whether an occasion is of that test."""
        return self.test in (occasion.reference, occasion.setup)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the joint of that test."""
        if not self.when(occasion):
            return rig
        index = tested.station.index(self.stage)
        joints = tested.station.stages[index].joints
        more = [(self.factor - 1) * joint.stiffness for joint in joints]
        return rig.with_matrices(stiffness=springs(joint_stretch(rig, tested, index), more))


def draw_drift(random: np.random.Generator, scene: Scene, place: str | None) -> Drift | None:
    """Draw joint, test and factor; of a test in several set-ups, a set-up as often as not."""
    stage = draw_spring_stage(random, scene.station, place)
    labels = sorted({occasion.reference for occasion in scene.occasions})
    setups = sorted({occasion.setup for occasion in scene.occasions})
    kinds = [names for names in (labels, setups) if len(names) > 1]
    if stage is None or not kinds:
        return None
    test = choose(random, choose(random, kinds))
    sites = {
        occasion.reference: hammer_site(scene.station, occasion.node)
        for occasion in scene.occasions
        if not occasion.label
    }
    return Drift(
        stage=stage,
        test=test,
        site=sites.get(test, ""),
        sign=sign(random),
        size=random.uniform(*LOG_FACTOR),
    )
