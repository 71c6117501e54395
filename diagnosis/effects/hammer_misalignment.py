"""Hits of one direction that went another way than drawn, beyond tolerance.

Turning a hit about its own direction changes nothing: that component keeps its tolerance.
"""

from collections.abc import Iterator
from dataclasses import replace

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
            whole = released("hammer_misalignment", place, direction, names, "rotation")
            across = tuple(name for name in names if name[-1] != direction[-1])
            yield replace(whole, release=across)
