"""A spring that is softer or stiffer than its prior or the state before: loose or cracked."""

from collections.abc import Iterator

from diagnosis.effects.spring_change import propose_changes
from diagnosis.hypothesis import Effect, Hypothesis, Scene


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each spring whose stiffness is known."""
    yield from propose_changes(scene, "stiffness")


EFFECT = Effect(
    propose,
    noun="another stiffness",
    means="a spring of {place} is softer or stiffer {direction}: loose, cracked, or clamped anew",
    confirm="look at the spring of {place} and its screws, tighten them, and repeat",
)
