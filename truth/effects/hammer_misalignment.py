"""A direction of hits that is askew."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.chance import choose, unit_vector
from truth.effects.effect import Answer, Scene, Vector
from truth.effects.places import draw_location, hammer_site
from truth.effects.sensors import turn
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import AXES

ANGLE = (0.07, 0.4)
LIMITS = (1e-3, 0.8)  # rad


@dataclass(frozen=True)
class HammerMisalignment(Vector):
    """All hits of one direction at one point are turned by a rotation vector, d becomes R d.

    The rotation is about an axis at right angles to the drawn direction: a turn about the
    direction itself is not felt.

    Args:
        size: angle [rad].
        node: that is hit.
        site: of the drawing, ``hit<node>`` or ``acc<node>``.
        axis: 0, 1, 2 for the drawn direction.
    """

    node: int
    site: str
    axis: int
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer(
            "hammer_misalignment",
            location=f"hammer:{self.site}",
            dof=f"t{AXES[self.axis]}",
            parameters={"rotation": self.vector},
        )

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with that hammer turned; the hammers of a node come in x, y, z."""
        del occasion
        hammers = list(tested.hammers)
        place = [hammer.node for hammer in hammers].index(self.node) + self.axis
        direction = turn(self.vector) @ hammers[place].direction
        hammers[place] = replace(hammers[place], direction=direction)
        return replace(tested, hammers=tuple(hammers))


def draw_hammer_misalignment(
    random: np.random.Generator, scene: Scene, place: str | None
) -> HammerMisalignment | None:
    """Draw a point and direction that the campaign hits, and the rotation."""
    nodes = sorted({occasion.node for occasion in scene.occasions if occasion.node >= 0})
    sites = [hammer_site(scene.station, node) for node in nodes]
    number = draw_location(random, place, [f"hammer:{site}" for site in sites])
    if number is None:
        return None
    axes = {occasion.axis for occasion in scene.occasions if occasion.node == nodes[number]}
    axis, drawn = choose(random, sorted(axes)), scene.station.aim_axes(nodes[number])
    return HammerMisalignment(
        node=nodes[number],
        site=sites[number],
        axis=axis,
        along=unit_vector(random, np.delete(drawn, axis, axis=0)),
        size=random.uniform(*ANGLE),
    )
