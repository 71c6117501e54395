"""A joint direction held by a control loop that acts late."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import AtDirection, draw_direction
from truth.effects.stability import longest_delay
from truth.machine.rig import FrequencyLaw, Occasion, Prepared, Rig, build
from truth.machine.station import Complex, Joint

SHARE = (0.2, 0.7)  # of the longest delay
SMALLEST = 1e-4  # of the longest delay
LONGEST = 0.02  # s


@dataclass(frozen=True)
class FeedbackDelay(AtDirection):
    r"""One spring becomes k exp(-s tau): the dynamic stiffness gains z(s) = k (exp(-s tau) - 1).

    To first order that is a damper of -k tau, and up to tau = c/k it takes no more than the joint's
    own damper gives. How much longer it may be depends on the machine: four fifths of what makes a
    mode unstable (``stability.longest_delay``).

    Args:
        size: tau [s].
        longest: delay that leaves the machine stable [s].
    """

    longest: float
    effect = "feedback_delay"

    @property
    def limits(self) -> tuple[float, float]:
        """Return smallest and largest delay [s]."""
        return SMALLEST * self.longest, self.longest

    def parameters(self) -> dict[str, float]:
        """Return the delay [s]."""
        return {"delay": self.size}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the late spring."""
        row = self.direction.stretch(rig, tested)
        stiffness = self.direction.joint(tested.station).stiffness
        law = FrequencyLaw(row, row, partial(_late, stiffness, self.size))
        return replace(rig, laws=(*rig.laws, law))


def _late(stiffness: float, delay: float, s: Complex) -> Complex:
    return np.asarray(stiffness * np.expm1(-s * delay))


def draw_feedback_delay(
    random: np.random.Generator, scene: Scene, place: str | None
) -> FeedbackDelay | None:
    """Draw a direction whose modes are damped, and a delay that they bear."""

    def loop(joint: Joint) -> bool:
        return joint.stiffness > 0 and joint.damping > 0

    direction = draw_direction(random, scene.station, place, loop)
    if direction is None:
        return None
    tested = Prepared(scene.station, ())
    rig = build(tested)
    row = direction.stretch(rig, tested)
    stiffness = direction.joint(scene.station).stiffness
    longest = min(longest_delay(rig, row, stiffness), LONGEST)
    return FeedbackDelay(
        direction=direction, longest=longest, size=longest * random.uniform(*SHARE)
    )
