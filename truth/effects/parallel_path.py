"""A link that bypasses joints: a hose, a cable, a bridge between two bodies."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import (
    body_motion,
    choose,
    draw_location,
    log_uniform,
    springs,
    unit_vector,
)
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import GROUND, Station

RATIO = (0.03, 0.3)
TIME_CONSTANT = (1e-4, 1e-3)  # s
ASIDE = 0.5  # of the distance of the centres of mass, along each axis
LIMITS = (1e-4, 3.0)
WORLD = "world"  # the ground


@dataclass(frozen=True)
class ParallelPath(Sized):
    r"""A spring and a damper between two bodies, in all directions or along one axis alone.

        f = k (u_upper - u_lower) + c (u'_upper - u'_lower),   c = k time_constant

    u being the motion of one point with each body, or its part along the axis: a bridge, a strut.

    Args:
        size: k over the geometric mean of the slides' stiffness on the way between the bodies.
        lower: name of the body that comes first in the station, or ``world`` for the ground.
        upper: name of the other.
        reference: that geometric mean [N/m].
        time_constant: c/k [s].
        aside: that point less the middle of both centres of mass, of a link to the ground less
            that of the body [m].
        axis: unit vector; none for all directions.
    """

    lower: str
    upper: str
    reference: float
    time_constant: float
    aside: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis: tuple[float, ...] | None = None
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found: the diagonals of both matrices in world axes."""
        along = np.ones(3) if self.axis is None else np.square(self.axis)
        stiffness = self.size * self.reference * along
        return Answer(
            "parallel_path",
            location=f"pair:{self.lower}-{self.upper}",
            parameters={
                "stiffness": tuple(stiffness.tolist()),
                "damping": tuple((stiffness * self.time_constant).tolist()),
            },
        )

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the link."""
        station = tested.station
        moving = [station.index(name) for name in (self.upper, self.lower) if name != WORLD]
        middle = np.mean([station.stages[index].com for index in moving], axis=0)
        motions = [
            body_motion(rig, tested, index, middle + np.array(self.aside)) for index in moving
        ]
        motion = motions[0] - sum(motions[1:], np.zeros_like(motions[0]))
        felt = motion[:3] if self.axis is None else np.array([self.axis]) @ motion[:3]
        stiffness = springs(felt, [self.size * self.reference] * len(felt))
        return rig.with_matrices(damping=self.time_constant * stiffness, stiffness=stiffness)


def draw_parallel_path(
    random: np.random.Generator, scene: Scene, place: str | None
) -> ParallelPath | None:
    """Draw two bodies that no joint joins, stiffness, damping, point and axis of the link.

    One may be the ground, ``world``, if it is named.
    """
    station = scene.station
    pairs = [
        (lower, upper, reference)
        for lower, upper in combinations(range(len(station.stages)), 2)
        if (reference := _reference(station, lower, upper))
    ]
    if place is not None and place.rpartition(":")[2].startswith(f"{WORLD}-"):
        pairs = [
            (GROUND, upper, reference)
            for upper in range(len(station.stages))
            if (reference := _reference(station, GROUND, upper))
        ]
    names = [*(stage.name for stage in station.stages), WORLD]  # the ground is number -1
    locations = [f"pair:{names[lower]}-{names[upper]}" for lower, upper, _ in pairs]
    number = draw_location(random, place, locations)
    if number is None:
        return None
    lower, upper, reference = pairs[number]
    whole = ParallelPath(
        lower=names[lower],
        upper=names[upper],
        reference=reference,
        time_constant=log_uniform(random, TIME_CONSTANT),
        size=log_uniform(random, RATIO),
    )
    stage = station.stages[upper]
    apart = float(np.linalg.norm(station.stages[lower].com - stage.com))
    if lower == GROUND:
        apart = float(np.sqrt(np.trace(stage.inertia) / stage.mass))
    aside = apart * random.uniform(-ASIDE, ASIDE, 3)
    is_strut, axis = choose(random, (True, False)), unit_vector(random)
    return replace(whole, aside=tuple(aside.tolist()), axis=axis if is_strut else None)


def _reference(station: Station, lower: int, upper: int) -> float | None:
    """Return the geometric mean of the slides' stiffness between two stages.

    None if no slide there has a spring, or if a joint joins the two.
    """
    if station.stages[upper].parent == lower:
        return None
    between = _ancestry(station, lower) ^ _ancestry(station, upper)
    stiffness = [
        joint.stiffness
        for index in between
        for joint in station.stages[index].joints
        if joint.kind == "slide" and joint.stiffness > 0
    ]
    return float(np.exp(np.mean(np.log(stiffness)))) if stiffness else None


def _ancestry(station: Station, index: int) -> frozenset[int]:
    """Return a stage and all that it stands on: the joints between it and the ground."""
    ancestors = set()
    while index != GROUND:
        ancestors.add(index)
        index = station.stages[index].parent
    return frozenset(ancestors)
