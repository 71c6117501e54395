"""A control loop that acts on one joint by what another one does."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import (
    AtDirection,
    StageDirection,
    choose,
    direction_of,
    draw_direction,
    sign,
)
from truth.effects.stability import largest_coupling
from truth.machine.rig import Occasion, Prepared, Rig, build
from truth.machine.station import Joint

SHARE = (0.2, 0.7)  # of the largest size
SMALLEST = 1e-4  # of the largest size
LARGEST = 20.0


@dataclass(frozen=True)
class Crosstalk(AtDirection):
    r"""A force along one joint direction from the speed of another stage's: C gains d a b^T.

    C is unsymmetric then, and FRFs are not reciprocal. With the dampers c_a and c_b of the two
    directions, C's symmetric part stays positive semidefinite up to |d| = 2 sqrt(c_a c_b), and
    with it the machine stable. How much more it bears depends on the machine: four fifths of what
    makes a mode unstable (``stability.largest_coupling``), and not more than 20 times the dampers.

    Args:
        size: |d| over sqrt(c_a c_b).
        direction: on which the force acts.
        source: whose speed is fed back.
        coupling: d at size 1, with its sign [N s/m], [N m s/rad] or between.
        largest: size that leaves the machine stable.
    """

    source: StageDirection
    coupling: float
    largest: float
    effect = "unexplained"
    kind = "crosstalk"

    @property
    def limits(self) -> tuple[float, float]:
        """Return smallest and largest size."""
        return SMALLEST * self.largest, self.largest

    def parameters(self) -> dict[str, float]:
        """Return d."""
        return {"coupling": self.size * self.coupling}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the feedback."""
        acts, feels = self.direction.stretch(rig, tested), self.source.stretch(rig, tested)
        return rig.with_matrices(damping=self.size * self.coupling * np.outer(acts, feels))


def _has_damper(joint: Joint) -> bool:
    return joint.damping > 0


def draw_crosstalk(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Crosstalk | None:
    """Draw two damped joint directions of two stages, and the sign of the coupling."""
    station = scene.station
    direction = draw_direction(random, station, place, _has_damper)
    if direction is None:
        return None
    sources = [
        StageDirection(stage.name, number, direction_of(joint))
        for stage in station.stages
        for number, joint in enumerate(stage.joints)
        if stage.name != direction.stage and _has_damper(joint)
    ]
    if not sources:
        return None
    source = choose(random, sources)
    dampers = direction.joint(station).damping, source.joint(station).damping
    coupling = sign(random) * float(np.sqrt(dampers[0] * dampers[1]))
    tested = Prepared(station, ())
    rig = build(tested)
    acts, feels = direction.stretch(rig, tested), source.stretch(rig, tested)
    largest = min(largest_coupling(rig, feels, coupling * acts), LARGEST)
    return Crosstalk(
        direction=direction,
        source=source,
        coupling=coupling,
        largest=largest,
        size=largest * random.uniform(*SHARE),
    )
