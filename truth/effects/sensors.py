"""Base of effects inside the measurement: one sensor or hammer point, and its dynamics."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import wraps
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from truth.effects.effect import Always, Draw, Effect, Scene
from truth.effects.places import draw_location, hammer_site
from truth.machine.rig import Filter, Occasion, Prepared, Response, Rig
from truth.machine.station import Real, Sensor, Station

_Site = TypeVar("_Site")
_Drawn = TypeVar("_Drawn", bound=Effect)


def draw_at(
    list_sites: Callable[[Scene], Mapping[str, _Site]],
) -> Callable[[Callable[[np.random.Generator, Scene, _Site], _Drawn]], Draw]:
    """Return a decorator: a draw of an effect at a given site becomes one that draws the site.

    Args:
        list_sites: returns the sites of a scene by location, ``sensor:acc11``; none: no effect.
    """

    def decorate(draw: Callable[[np.random.Generator, Scene, _Site], _Drawn]) -> Draw:
        @wraps(draw)
        def draw_there(
            random: np.random.Generator, scene: Scene, place: str | None
        ) -> _Drawn | None:
            sites = list_sites(scene)
            number = draw_location(random, place, list(sites))
            return None if number is None else draw(random, scene, [*sites.values()][number])

        return draw_there

    return decorate


def list_sensors(scene: Scene) -> dict[str, int]:
    """Return the node of each accelerometer by its location."""
    sensors = scene.station.accelerometers()
    return {f"sensor:acc{sensor.node}": sensor.node for _, sensor in sensors}


def list_hammers(scene: Scene) -> dict[str, str]:
    """Return the site by which the one hammer is named, that of the first hit; none without hits.

    A random number is spent as if there were several hammers.
    """
    if any(occasion.node < 0 for occasion in scene.occasions):
        return {}  # motors have force channels of their own
    sites = [hammer_site(scene.station, occasion.node) for occasion in scene.occasions[:1]]
    return {f"hammer:{site}": site for site in sites}


def list_hit_points(scene: Scene) -> dict[str, int]:
    """Return the node of each point that the campaign hits by its location."""
    nodes = sorted({occasion.node for occasion in scene.occasions if occasion.node >= 0})
    return {f"hammer:{hammer_site(scene.station, node)}": node for node in nodes}


@dataclass(frozen=True)
class AtSensor(Always):
    """An effect of one sensor: what the sensor is, or what it does to its three readings."""

    node: int

    @property
    def location(self) -> str:
        """Return the sensor as in an answer."""
        return f"sensor:acc{self.node}"

    def change(self, sensor: Sensor) -> Sensor:
        """Return the true sensor."""
        return sensor

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the true sensor."""
        stages = tuple(
            replace(stage, sensors=tuple(map(self._change_matching, stage.sensors)))
            for stage in tested.station.stages
        )
        return replace(tested, station=replace(tested.station, stages=stages))

    def _change_matching(self, sensor: Sensor) -> Sensor:
        return self.change(sensor) if sensor.node == self.node else sensor


def outputs(station: Station, node: int) -> tuple[int, int, int]:
    """Return the three rows of a sensor in a rig."""
    first = 3 * [sensor.node for _, sensor in station.sensors()].index(node)
    return first, first + 1, first + 2


def filter_readings(rig: Rig, rows: tuple[int, ...], response: Response) -> Rig:
    """Return the rig with dynamics on some of its readings."""
    return replace(rig, filters=(*rig.filters, Filter(rows, response)))


def turn(rotation: tuple[float, ...]) -> Real:
    """Return the matrix R of a rotation vector [rad]: a direction d becomes R d; (3, 3)."""
    return np.asarray(Rotation.from_rotvec(rotation).as_matrix())
