"""Hits of one direction that went another way than drawn, beyond tolerance."""

from collections.abc import Iterator

from diagnosis.effects.points import hits, names_of, three
from diagnosis.hypothesis import Hypothesis, Scene, released


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each direction of each point that was hit."""
    known = names_of(scene)
    for dof in hits(scene):
        direction = dof.direction[1:]
        names = three(f"hammer({dof.point}:{direction}).rotation_")
        if known.issuperset(names):
            place = f"hammer:{dof.point}"
            yield released("hammer_misalignment", place, direction, names, "rotation")
