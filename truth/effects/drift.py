"""Joints that are stiffer or softer in some tests: a machine that warms up, a bolt that settles."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import (
    choose,
    draw_spring_stage,
    hammer_site,
    joint_stretch,
    sign,
    springs,
)
from truth.machine.rig import Occasion, Prepared, Rig

LOG_FACTOR = (0.1, 0.5)
LEVEL_LOG_FACTOR = (0.05, 0.3)  # of a joint that warms up or settles during a day of tests


@dataclass(frozen=True, kw_only=True)
class JointDrift(Sized):
    """All springs of a joint times a factor, which depends on the occasion.

    Args:
        size: |log factor|.
        stage: name of the child body.
        sign: +1 stiffer, -1 softer.
    """

    stage: str
    sign: int
    limits = (1e-3, 1.5)

    def factor_on(self, occasion: Occasion) -> float:
        """Return the factor on an occasion."""
        raise NotImplementedError

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the joint of that occasion."""
        factor, index = self.factor_on(occasion), tested.station.index(self.stage)
        if factor == 1:
            return rig
        more = [(factor - 1) * joint.stiffness for joint in tested.station.stages[index].joints]
        return rig.with_matrices(stiffness=springs(joint_stretch(rig, tested, index), more))


@dataclass(frozen=True, kw_only=True)
class Drift(JointDrift):
    """A factor exp(sign size) in one test or one set-up.

    Args:
        test: label of a reference, such as ``acc11:+ty``, or name of a set-up.
        site: of the reference as the drawing has it, ``hit29`` for ``acc29``; empty of a set-up.
    """

    test: str
    site: str = ""

    @property
    def factor(self) -> float:
        """Return the factor."""
        return float(np.exp(self.sign * self.size))

    def answer(self) -> Answer:
        """Return what is to be found."""
        dof = f"{self.site}:{self.test.partition(':')[2]}" if self.site else self.test
        return Answer("drift", f"joint:{self.stage}", dof, {"factor": self.factor})

    def when(self, occasion: Occasion) -> bool:
        """Tell whether an occasion is of that test."""
        return self.test in (occasion.reference, occasion.setup)

    def factor_on(self, occasion: Occasion) -> float:
        """Return the factor in that test, 1 in others."""
        return self.factor if self.when(occasion) else 1.0


@dataclass(frozen=True, kw_only=True)
class LevelDrift(JointDrift):
    """A factor exp(sign size v / (V - 1)) at visit v of V to a level: a law that is none.

    Args:
        size: |log factor| at the last visit.
        visits: V, number of visits.
    """

    visits: int

    def factor(self, visit: int) -> float:
        """Return the factor at a visit, counted from 0."""
        return float(np.exp(self.sign * self.size * visit / (self.visits - 1)))

    def answer(self) -> Answer:
        """Return what is to be found."""
        factors = {f"factor_{visit + 1}": self.factor(visit) for visit in range(1, self.visits)}
        return Answer("drift", f"joint:{self.stage}", "levels", factors)

    def when(self, occasion: Occasion) -> int:
        """Return the visit, which alone matters."""
        return occasion.visit

    def factor_on(self, occasion: Occasion) -> float:
        """Return the factor at the occasion's visit."""
        return self.factor(occasion.visit)


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


def draw_level_drift(
    random: np.random.Generator, scene: Scene, place: str | None
) -> LevelDrift | None:
    """Draw joint and factor; None for a campaign of one visit."""
    stage = draw_spring_stage(random, scene.station, place)
    visits = 1 + max((occasion.visit for occasion in scene.occasions), default=0)
    if stage is None or visits < 2:
        return None
    towards, size = sign(random), random.uniform(*LEVEL_LOG_FACTOR)
    return LevelDrift(stage=stage, visits=visits, sign=towards, size=size)
