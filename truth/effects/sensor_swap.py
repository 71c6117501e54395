"""Two cables exchanged: two channels of a sensor, or two whole sensors."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from truth.effects.chance import choose
from truth.effects.effect import Answer, Scene, Unsized
from truth.effects.places import draw_location
from truth.effects.sensors import outputs
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import AXES


@dataclass(frozen=True)
class SensorSwap(Unsized):
    """What one channel records appears as the other's, with everything its sensor does.

    Among several effects it comes after those of sensors, which belong to the sensor and not to
    the row of the file.

    Args:
        nodes: one sensor, of which two channels are exchanged, or two sensors.
        axes: 0, 1, 2 of the two channels; empty if sensors are exchanged.
    """

    nodes: tuple[int, ...]
    axes: tuple[int, ...] = ()

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer(
            "sensor_swap",
            location="sensor:" + "+".join(f"acc{node}" for node in self.nodes),
            dof="+".join(f"t{AXES[axis]}" for axis in self.axes),
        )

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with readings and filters exchanged."""
        del occasion
        rows = [outputs(tested.station, node) for node in self.nodes]
        pairs = list(zip(*rows, strict=True))
        if self.axes:
            first, second = (rows[0][axis] for axis in self.axes)
            pairs = [(first, second)]
        order = np.arange(len(rig.readout))
        for first, second in pairs:
            order[[first, second]] = second, first
        # An exchange is its own inverse: row i shows what row order[i] was.
        filters = tuple(
            replace(each, outputs=tuple(int(order[output]) for output in each.outputs))
            for each in rig.filters
        )
        return replace(rig, readout=rig.readout[order], filters=filters)


def draw_sensor_swap(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SensorSwap | None:
    """Draw one sensor and two channels as often as two sensors."""
    nodes = sorted(sensor.node for _, sensor in scene.station.sensors())
    single: list[tuple[int, ...]] = [(node,) for node in nodes]
    double: list[tuple[int, ...]] = list(combinations(nodes, 2))
    kind = choose(random, (single, double or single))
    axes = choose(random, tuple(combinations(range(3), 2)))
    if place is not None:
        kind = single + double
    locations = ["sensor:" + "+".join(f"acc{node}" for node in some) for some in kind]
    number = draw_location(random, place, locations)
    if number is None:
        return None
    swapped = kind[number]
    return SensorSwap(nodes=swapped, axes=axes if len(swapped) == 1 else ())
