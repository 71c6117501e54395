"""A spring that changes while it is measured: the hits of one column meet different machines."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import AtDirection, draw_direction, sign
from truth.machine.rig import Occasion, Prepared, Rig

LOG_FACTOR = (0.1, 0.5)
LIMITS = (1e-3, 1.5)
STEPS = 4  # of the change, so that five machines arise


@dataclass(frozen=True)
class ChangingStiffness(AtDirection):
    """The stiffness of one joint direction is k exp(sign size t), t from 0 to 1 in each column.

    The time goes in quarters: five machines in all.

    Args:
        size: |log| of the stiffness at the end over that at the start.
        direction: of the joint.
        sign: +1 becomes stiffer, -1 softer.
    """

    sign: int
    effect = "unexplained"
    kind = "changing_stiffness"
    limits = LIMITS

    def parameters(self) -> dict[str, float]:
        """Return the stiffness at the end over that at the start."""
        return {"factor": float(np.exp(self.sign * self.size))}

    def when(self, occasion: Occasion) -> float:
        """Return the time, rounded to quarters."""
        return round(STEPS * occasion.time) / STEPS

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig at the occasion's time."""
        row = self.direction.stretch(rig, tested)
        stiffness = self.direction.joint(tested.station).stiffness
        more = stiffness * np.expm1(self.sign * self.size * self.when(occasion))
        return rig.with_matrices(stiffness=more * np.outer(row, row))


def draw_changing_stiffness(
    random: np.random.Generator, scene: Scene, place: str | None
) -> ChangingStiffness | None:
    """Draw a joint direction, and whether it becomes stiffer or softer."""
    direction = draw_direction(random, scene.station, place)
    if direction is None:
        return None
    return ChangingStiffness(
        direction=direction, sign=sign(random), size=random.uniform(*LOG_FACTOR)
    )
