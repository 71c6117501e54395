"""What effects inside the measurement share: one sensor of the machine, its rows, its dynamics."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from truth.machine.rig import Filter, Prepared, Response, Rig
from truth.machine.station import Real, Sensor, Station


def with_sensor(tested: Prepared, node: int, change: Callable[[Sensor], Sensor]) -> Prepared:
    """Return the machine with one sensor changed."""

    def change_matching(sensor: Sensor) -> Sensor:
        return change(sensor) if sensor.node == node else sensor

    stages = tuple(
        replace(stage, sensors=tuple(change_matching(sensor) for sensor in stage.sensors))
        for stage in tested.station.stages
    )
    return replace(tested, station=replace(tested.station, stages=stages))


def outputs(station: Station, node: int) -> tuple[int, int, int]:
    """Return the three rows of a sensor in a rig."""
    first = 3 * [sensor.node for _, sensor in station.sensors()].index(node)
    return first, first + 1, first + 2


def filter_readings(rig: Rig, tested: Prepared, node: int, response: Response) -> Rig:
    """Return the rig with dynamics of one sensor on its three readings."""
    sensor_filter = Filter(outputs(tested.station, node), response)
    return replace(rig, filters=(*rig.filters, sensor_filter))


def turn(rotation: tuple[float, ...]) -> Real:
    """Return the matrix R of a rotation vector [rad]: a direction d becomes R d; (3, 3)."""
    return np.asarray(Rotation.from_rotvec(rotation).as_matrix())
