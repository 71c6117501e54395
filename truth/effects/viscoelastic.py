"""A joint that becomes stiffer with frequency: rubber, grease, glue."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.chance import log_uniform
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_spring_stage
from truth.effects.rows import joint_stretch
from truth.machine.rig import FrequencyLaw, Occasion, Prepared, Rig
from truth.machine.station import Complex

RATIO = (0.1, 0.8)
CORNER_HZ = (10.0, 150.0)
# A branch of ten times the joint's stiffness is another joint: stiffness and damping that are tuned
# take all of it, whatever a refit that is linear about the true machine says.
LIMITS = (1e-3, 2.0)


@dataclass(frozen=True)
class Viscoelastic(Sized):
    r"""A spring and a damper in series (Maxwell) beside every spring k of a joint.

        z(s) = k r s tau / (1 + s tau)

    It is not felt slowly and adds r k at high frequency; its loss is largest at 1/(2 pi tau).

    Args:
        size: r, stiffness of the branch over the static stiffness.
        stage: name of the child body.
        tau: [s].
    """

    stage: str
    tau: float
    limits = LIMITS

    def __post_init__(self) -> None:
        """Check that the branch can exist."""
        super().__post_init__()
        self.require(0 < self.tau < np.inf)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"ratio": self.size, "tau": self.tau}
        return Answer("viscoelastic", location=f"joint:{self.stage}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with one law for every joint direction."""
        del occasion
        index = tested.station.index(self.stage)
        joints, rows = tested.station.stages[index].joints, joint_stretch(rig, tested, index)
        laws = tuple(
            FrequencyLaw(row, row, partial(_branch, joint.stiffness * self.size, self.tau))
            for joint, row in zip(joints, rows, strict=True)
            if joint.stiffness > 0
        )
        return replace(rig, laws=(*rig.laws, *laws))


def _branch(stiffness: float, tau: float, s: Complex) -> Complex:
    return stiffness * s * tau / (1 + s * tau)


def draw_viscoelastic(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Viscoelastic | None:
    """Draw joint, ratio and time constant."""
    stage = draw_spring_stage(random, scene.station, place)
    if stage is None:
        return None
    corner = log_uniform(random, CORNER_HZ)
    return Viscoelastic(stage=stage, tau=1 / (2 * np.pi * corner), size=log_uniform(random, RATIO))
