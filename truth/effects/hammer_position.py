"""Hits that lie elsewhere than drawn: all directions of one point."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.chance import log_uniform, unit_vector
from truth.effects.effect import Answer, Scene, Vector
from truth.effects.places import draw_location, hammer_site
from truth.machine.rig import Occasion, Prepared

OFFSET = (0.01, 0.04)  # m, beyond the tolerance of 3 mm
LIMITS = (1e-3, 0.3)  # m


@dataclass(frozen=True)
class HammerPosition(Vector):
    """All hits at one point are displaced by a vector.

    Args:
        size: length of the offset [m].
        node: that is hit.
        site: of the drawing, ``hit<node>`` or ``acc<node>``.
    """

    node: int
    site: str
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("hammer_position", f"hammer:{self.site}", parameters={"offset": self.vector})

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the hits of that node elsewhere."""
        del occasion
        hammers = tuple(
            replace(hammer, position=hammer.position + np.array(self.vector))
            if hammer.node == self.node
            else hammer
            for hammer in tested.hammers
        )
        return replace(tested, hammers=hammers)


def draw_hammer_position(
    random: np.random.Generator, scene: Scene, place: str | None
) -> HammerPosition | None:
    """Draw a point that the campaign hits, and the offset."""
    nodes = sorted({occasion.node for occasion in scene.occasions if occasion.node >= 0})
    sites = [hammer_site(scene.station, node) for node in nodes]
    number = draw_location(random, place, [f"hammer:{site}" for site in sites])
    if number is None:
        return None
    return HammerPosition(
        node=nodes[number],
        site=sites[number],
        along=unit_vector(random),
        size=log_uniform(random, OFFSET),
    )
