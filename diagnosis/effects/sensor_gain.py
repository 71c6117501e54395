"""A channel with a gain beyond its tolerance: a wrong calibration value."""

from collections.abc import Iterator
from dataclasses import replace

from diagnosis.effects.scales import GAIN_ENDS
from diagnosis.hypothesis import Effect, Hypothesis, Scene, release_tolerance
from diagnosis.scene_points import list_gains, list_sensors, list_varying_names
from identification import FAULT_PHRASES


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each channel whose gain has a tolerance."""
    varying = list_varying_names(scene)
    unknown = scene.session.campaign.unknown_gains.sensors
    for site in (site for site in list_sensors(scene) if site not in unknown):
        for direction, name in list_gains(site):
            if name in varying:
                released = release_tolerance(
                    "sensor_gain", f"sensor:{site}", direction, (name,), "gain"
                )
                yield replace(released, bounds={name: GAIN_ENDS})


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_gain"],
    means="the calibration value of {channel} is wrong",
    confirm="exchange {place} and repeat one hit: the gain goes with it",
    undoes=True,
)
