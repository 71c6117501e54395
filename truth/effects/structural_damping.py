"""Loss that does not grow with frequency, as in bolted joints and elastomers."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_spring_stage
from truth.effects.rows import joint_stretch, springs
from truth.machine.rig import FrequencyLaw, Occasion, Prepared, Rig
from truth.machine.station import Complex

LOSS = (0.03, 0.2)
LIMITS = (1e-4, 0.6)
GONE = 0.05  # loss factor from which the viscous damping is down to its share


@dataclass(frozen=True)
class StructuralDamping(Sized):
    r"""Every spring of a joint becomes k (1 + i eta), its damper keeps a part of itself.

        z(s) = i k eta sign(Im s),   c' = c (1 - (1 - share) min(1, eta / 0.05))

    so that with the loss factor the whole effect vanishes. A spring's loss is the same at each
    frequency; the force is not causal in time, as always with this textbook law.

    Args:
        size: loss factor eta.
        stage: name of the child body.
        share: of the viscous damping that stays once eta is 0.05 or more.
    """

    stage: str
    share: float
    limits = LIMITS

    def __post_init__(self) -> None:
        """Check that no damper becomes negative."""
        super().__post_init__()
        self.require(0 <= self.share <= 1)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"loss_factor": self.size}
        return Answer("structural_damping", location=f"joint:{self.stage}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with one law for every joint direction."""
        index = tested.station.index(self.stage)
        joints, rows = tested.station.stages[index].joints, joint_stretch(rig, tested, index)
        laws = tuple(
            FrequencyLaw(row, row, partial(_loss, joint.stiffness * self.size))
            for joint, row in zip(joints, rows, strict=True)
            if joint.stiffness > 0
        )
        gone = (1 - self.share) * min(1.0, self.size / GONE)
        less = springs(rows, [-gone * joint.damping for joint in joints])
        return replace(rig.with_matrices(damping=less), laws=(*rig.laws, *laws))


def _loss(loss: float, s: Complex) -> Complex:
    return 1j * loss * np.sign(s.imag)


def draw_structural_damping(
    random: np.random.Generator, scene: Scene, place: str | None
) -> StructuralDamping | None:
    """Draw joint, loss factor and what remains of the viscous damping."""
    stage = draw_spring_stage(random, scene.station, place)
    if stage is None:
        return None
    return StructuralDamping(stage=stage, share=random.uniform(0, 1), size=random.uniform(*LOSS))
