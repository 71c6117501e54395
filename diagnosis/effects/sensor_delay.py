"""A sensor whose channels lag by more than their tolerance: another amplifier or filter.

The lag multiplies its readings by exp(-i w delay). The verdict states the mean delay of its
channels. On a body with redundant channels the data checks prove the delay without a model.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_delays, list_sensors, list_varying_names
from diagnosis.stated_values import Value
from identification import FAULT_PHRASES
from identification.words import Dof, Output


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each sensor whose delays have a tolerance."""
    varying = list_varying_names(scene)
    measured = {(dof.point, _direction(dof)) for dof in scene.session.campaign.outputs}
    for site in list_sensors(scene):
        names = tuple(
            name
            for direction, name in list_delays(site)
            if name in varying and (site, direction) in measured
        )
        if names:
            yield _release_delays(site, names)


def _direction(channel: Output) -> str | None:
    """Return the direction of a channel, None for a signal."""
    return channel.direction[1:] if isinstance(channel, Dof) else None


def _release_delays(site: str, names: tuple[str, ...]) -> Hypothesis:
    """Return the hypothesis that releases the delays of a sensor's channels."""

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        return {"delay": float(np.mean([fitted[name] for name in names]))}

    return Hypothesis("sensor_delay", f"sensor:{site}", release=names, state=state)


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_delay"],
    means="the channels of {place} come late",
    confirm="give {place} another input of the analyser and repeat one hit",
    undoes=True,
)
