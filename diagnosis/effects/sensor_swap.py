"""Two channels of one sensor that are exchanged, as by their cables.

It is no rotation, but a mirror image. No slope leads to it: the score test frees both gains and
the transverse sensitivity that both channels have in common, if it has a tolerance. Together they
describe the exchange. A refit to the channels exchanged back decides. On a body with redundant
channels the data checks prove it without a model, and the exchange of two sensors too.
"""

from collections.abc import Iterator
from functools import partial
from itertools import combinations

from diagnosis.corrections import exchange_channels
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_sensors, list_varying_names
from identification import FAULT_PHRASES
from identification.words import Dof


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each two translations of a sensor that some test reads."""
    varying = list_varying_names(scene)
    outputs = scene.session.campaign.outputs
    measured = {dof.positive for dof in outputs if isinstance(dof, Dof)}
    sites = {dof.point for dof in measured}
    for site in (site for site in list_sensors(scene) if site in sites):
        for axes in combinations("xyz", 2):
            first, second = (Dof(site, f"+t{axis}") for axis in axes)
            gains = tuple(f"{site}.gain_{axis}" for axis in axes)
            if {first, second} <= measured and varying.issuperset(gains):
                cross = f"{site}.cross_{''.join(axes)}"
                scored = (*gains, cross) if cross in varying else gains
                correct = partial(exchange_channels, pairs=((first, second),))
                directions = "+".join(f"t{axis}" for axis in axes)
                yield Hypothesis(
                    "sensor_swap", f"sensor:{site}", directions, scored=scored, correct=correct
                )


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_swap"],
    means="channels are exchanged: {channel}",
    confirm="knock at {place} along each axis in turn and see which channel answers",
)
