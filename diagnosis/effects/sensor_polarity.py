"""A channel with an inverted sign.

No slope leads from a gain of 1 to -1. The score test therefore frees the gain, and a refit to the
channel with the sign corrected decides. On a body with redundant channels the data checks prove it
without a model.
"""

from collections.abc import Iterator
from functools import partial

from diagnosis.corrections import divide_channels, match_channels, read_inverted
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_gains, list_sensors, list_varying_names
from identification import FAULT_PHRASES


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each channel."""
    varying = list_varying_names(scene)
    unknown = scene.session.campaign.unknown_gains.sensors
    for site in (site for site in list_sensors(scene) if site not in unknown):
        for direction, gain in list_gains(site):
            if gain in varying:
                place = f"sensor:{site}"
                concerns = match_channels(place, direction)
                correct = partial(divide_channels, concerns=concerns, reading=read_inverted)
                yield Hypothesis(
                    "sensor_polarity", place, direction, scored=(gain,), correct=correct
                )


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_polarity"],
    means="{channel} has the wrong sign",
    confirm="turn the sign of {channel} back, or look how its axis points",
)
