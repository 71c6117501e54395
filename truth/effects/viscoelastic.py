"""A joint that becomes stiffer with frequency: rubber, grease, glue."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.chance import choose, log_uniform
from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import direction_of, draw_spring_stage, has_spring
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
    r"""A spring and a damper in series (Maxwell) beside one spring k of a joint, or all alike.

        z(s) = k r s tau / (1 + s tau)

    It is not felt slowly and adds r k at high frequency; its loss is largest at 1/(2 pi tau).

    Args:
        size: r, stiffness of the branch over the static stiffness.
        stage: name of the child body.
        tau: [s].
        dof: direction of the one spring, such as ``tz``; empty: all springs.
    """

    stage: str
    tau: float
    dof: str = ""
    limits = LIMITS

    def __post_init__(self) -> None:
        """Check that the branch can exist."""
        super().__post_init__()
        self.require(0 < self.tau < np.inf)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"ratio": self.size, "tau": self.tau}
        place = f"joint:{self.stage}"
        return Answer("viscoelastic", location=place, dof=self.dof, parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with one law for each joint direction that has a branch."""
        index = tested.station.index(self.stage)
        joints, rows = tested.station.stages[index].joints, joint_stretch(rig, tested, index)
        laws = tuple(
            FrequencyLaw(row, row, partial(_branch, joint.stiffness * self.size, self.tau))
            for joint, row in zip(joints, rows, strict=True)
            if has_spring(joint) and self.dof in ("", direction_of(joint))
        )
        return replace(rig, laws=(*rig.laws, *laws))


def _branch(stiffness: float, tau: float, s: Complex) -> Complex:
    return stiffness * s * tau / (1 + s * tau)


def draw_viscoelastic(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Viscoelastic | None:
    """Draw joint, ratio, time constant, and one of the springs or all of them."""
    stage = draw_spring_stage(random, scene.station, place)
    if stage is None:
        return None
    corner = log_uniform(random, CORNER_HZ)
    size = log_uniform(random, RATIO)
    joints = scene.station.stages[scene.station.index(stage)].joints
    directions = [direction_of(joint) for joint in joints if has_spring(joint)]
    dof = choose(random, directions) if random.integers(2) else ""
    return Viscoelastic(stage=stage, tau=1 / (2 * np.pi * corner), size=size, dof=dof)
