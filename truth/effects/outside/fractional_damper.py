"""A damper between spring and dashpot: the force follows a fractional derivative of the motion."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import AtDirection, draw_direction, log_uniform
from truth.machine.rig import FrequencyLaw, Occasion, Prepared, Rig
from truth.machine.station import Complex

RATIO = (0.1, 0.6)
LIMITS = (1e-3, 5.0)
ORDER = (0.3, 0.7)
REFERENCE_HZ = 50.0


@dataclass(frozen=True)
class FractionalDamper(AtDirection):
    r"""A force c d^alpha x / dt^alpha along one joint direction: z(s) = c s^alpha, alpha < 1.

    The principal value of s^alpha has a positive real part on the right half plane: passive.

    Args:
        size: |z| at 50 Hz over the spring's stiffness.
        direction: of the joint.
        stiffness: of its spring.
        order: alpha.
    """

    stiffness: float
    order: float
    effect = "unexplained"
    kind = "fractional_damper"
    limits = LIMITS

    def __post_init__(self) -> None:
        """Check that it is between spring and damper."""
        super().__post_init__()
        self.require(0 < self.order < 1)

    @property
    def coefficient(self) -> float:
        """Return c [N s^alpha / m] or [N m s^alpha / rad]."""
        return float(self.size * self.stiffness / (2 * np.pi * REFERENCE_HZ) ** self.order)

    def parameters(self) -> dict[str, float]:
        """Return c and alpha."""
        return {"coefficient": self.coefficient, "order": self.order}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the damper."""
        row = self.direction.stretch(rig, tested)
        law = FrequencyLaw(row, row, partial(_power, self.coefficient, self.order))
        return replace(rig, laws=(*rig.laws, law))


def _power(coefficient: float, order: float, s: Complex) -> Complex:
    return np.asarray(coefficient * s**order)


def draw_fractional_damper(
    random: np.random.Generator, scene: Scene, place: str | None
) -> FractionalDamper | None:
    """Draw a joint direction, the order and the strength."""
    direction = draw_direction(random, scene.station, place)
    if direction is None:
        return None
    return FractionalDamper(
        direction=direction,
        stiffness=direction.joint(scene.station).stiffness,
        order=random.uniform(*ORDER),
        size=log_uniform(random, RATIO),
    )
