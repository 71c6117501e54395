"""Hits of one direction that went another way than drawn, beyond tolerance."""

from collections.abc import Iterator, Mapping

from diagnosis.effects.points import hits, names_of, three
from diagnosis.hypothesis import Hypothesis, Scene, Value


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each direction of each point that was hit."""
    known = names_of(scene)
    for dof in hits(scene):
        names = three(f"hammer({dof.point}:{dof.direction[1:]}).rotation_")
        if known.issuperset(names):

            def state(
                found: Mapping[str, float], angles: tuple[str, ...] = names
            ) -> dict[str, Value]:
                return {"rotation": tuple(found[name] for name in angles)}

            yield Hypothesis(
                "hammer_misalignment",
                f"hammer:{dof.point}",
                dof.direction[1:],
                release=names,
                state=state,
            )
