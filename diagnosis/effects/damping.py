"""A damper that is weaker or stronger than its prior or the state before: worn, rubbing, added."""

from collections.abc import Iterator

from diagnosis.effects.spring_change import propose_changes
from diagnosis.hypothesis import Effect, Hypothesis, Scene


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each damper whose damping is known."""
    yield from propose_changes(scene, "damping")


EFFECT = Effect(
    propose,
    noun="another damping",
    means="a damper of {place} is weaker or stronger {direction}: worn, rubbing, or added",
    confirm="look at {place} for what rubs or leaks, take cables off, and repeat",
)
