"""A force channel or a drive that comes late or early by more than its tolerance.

All FRFs of its tests are multiplied: H_measured = exp(-i w delay) H. A force channel that lags the
motion has a negative delay.
"""

from collections.abc import Iterator

from diagnosis.effects.points import hammer_place, instruments, names_of
from diagnosis.hypothesis import Effect, Hypothesis, Scene, release_tolerance


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each hammer or drive whose delay has a tolerance."""
    varying = names_of(scene)
    for instrument in instruments(scene):
        name = f"hammer({instrument}).delay"
        if name in varying:
            place = hammer_place(scene, instrument)
            yield release_tolerance("hammer_delay", place, None, (name,), "delay")


EFFECT = Effect(
    propose,
    noun="a delay of the force channel",
    means="the force channel of {place} comes late or early against the motion",
    confirm=(
        "give the hammer of {place} another input of the analyser, with the filter of the motion "
        "channels, and repeat one hit"
    ),
    undoes=True,
)
