"""A force channel or drive with a delay beyond its tolerance.

The delay multiplies all FRFs of its tests: H_measured = exp(-i w delay) H. A force channel that
lags the motion has a negative delay.
"""

from collections.abc import Iterator

from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import release_hammers


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Return one for each hammer or drive whose delay has a tolerance."""
    return release_hammers(scene, "hammer_delay", "delay")


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
