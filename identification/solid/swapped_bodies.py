"""Sensors on other bodies than drawn: two that are exchanged, or one whose body is wrong.

Bodies then look faulty, and are not.
"""

from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from identification.solid.body_channels import ChannelTable, body_data
from identification.solid.fault_search import (
    MIN_REDUNDANT_CHANNELS,
    FaultSearch,
    count_channels,
)
from identification.solid.moments import Moments
from identification.solid.rigid_fit import fit_errors
from identification.solid.sensor_faults import BelievedBody
from identification.words import Campaign, node_number

# Prior cost of a swap [nats]: one campaign in a hundred, one pair in some hundreds.
_SWAP_PRIOR_NATS = 10.0
_MIN_SWAP_GAIN_NATS = 3.0  # gain of log evidence from which a swap is accepted; odds of 20 to 1


@dataclass(frozen=True, eq=False)
class BodySwap:
    """An exchange of two sensors of different bodies.

    Args:
        table: channels with those of the two sensors exchanged.
        bodies: the two bodies.
        location: ``sensor:acc1+acc7``.
        probability: posterior probability against separate explanations of both bodies.
    """

    table: ChannelTable
    bodies: tuple[str, str]
    location: str
    probability: float


def find_body_swap(
    table: ChannelTable, campaign: Campaign, searches: list[FaultSearch]
) -> BodySwap | None:
    """Return the best exchange of two sensors if it explains two bodies better than faults."""
    suspects = [search for search in searches if search.accepted or search.has_unexplained]
    best: tuple[float, BodySwap] | None = None
    for first, second in combinations(suspects, 2):
        if first.nats + second.nats <= _SWAP_PRIOR_NATS + _MIN_SWAP_GAIN_NATS:
            continue
        for a, b in product(first.data.sensors.names, second.data.sensors.names):
            swapped = _swap_sensors(table, a, b)
            if swapped is None:
                continue
            bodies = (first.data.body, second.data.body)
            own_gain = first.nats - _healthy_nats(swapped, campaign, first.data.body)
            if own_gain <= 0:  # an exchange spoils both bodies, so that its correction mends both
                continue
            gain = own_gain + second.nats - _healthy_nats(swapped, campaign, second.data.body)
            gain -= _SWAP_PRIOR_NATS
            if gain > _MIN_SWAP_GAIN_NATS and (best is None or gain > best[0]):
                probability = float(1 / (1 + np.exp(-gain)))
                pair = "+".join(sorted((a, b), key=lambda name: (node_number(name) or 0, name)))
                best = gain, BodySwap(swapped, bodies, f"sensor:{pair}", probability)
    return None if best is None else best[1]


def _swap_sensors(table: ChannelTable, first: str, second: str) -> ChannelTable | None:
    """Return the table with the readings of two sensors exchanged; None if directions differ."""
    places = {dof: k for k, dof in enumerate(table.channels)}
    first_places = {dof.direction: k for dof, k in places.items() if dof.point == first}
    second_places = {dof.direction: k for dof, k in places.items() if dof.point == second}
    if first_places.keys() != second_places.keys():
        return None
    order = list(range(len(table.channels)))
    for direction, k in first_places.items():
        order[k], order[second_places[direction]] = second_places[direction], k
    return replace(
        table,
        values=table.values[:, :, order],
        variance=table.variance[:, :, order],
        measured=table.measured[:, order],
    )


def _healthy_nats(table: ChannelTable, campaign: Campaign, body: str) -> float:
    """Return the cost of a body without a fault [nats]."""
    data = body_data(table, campaign, body)
    if data is None:
        return 0.0
    fitted = fit_errors(
        BelievedBody.healthy(data, campaign.tolerance).model, Moments.of(data, blocks=1)
    )
    return fitted.data + fitted.prior


@dataclass(frozen=True, eq=False)
class MovedSensor:
    """A sensor that sits on another body than drawn.

    Args:
        campaign: campaign whose layout has the sensor on its true body.
        site: the sensor.
        bodies: the drawn body and the true one.
        probability: posterior probability against separate explanations of both bodies.
    """

    campaign: Campaign
    site: str
    bodies: tuple[str, str]
    probability: float

    @property
    def phrase(self) -> str:
        """Sensor and body, with the key that corrects the layout."""
        drawn, true = self.bodies
        return (
            f"{self.site} moves with {true}, not with {drawn}: correct its body in the model, or "
            f'set body = "{true}" in [sensor.{self.site}]'
        )


def find_moved_sensor(
    table: ChannelTable, campaign: Campaign, searches: list[FaultSearch]
) -> MovedSensor | None:
    """Return the best move of a sensor to another body, if it beats all faults of the first.

    The other body must gain redundant channels: otherwise it would take any sensor.
    """
    best: tuple[float, MovedSensor] | None = None
    layout = campaign.layout
    for first in searches:
        if not first.accepted and not first.has_unexplained:
            continue
        for site, second in product(first.data.sensors.names, searches):
            if second is first or site not in layout.points:
                continue
            bodies = (first.data.body, second.data.body)
            axes = layout.axes[layout.points.index(site)]
            moved = replace(campaign, layout=layout.with_point_axes(site, axes, bodies[1]))
            remaining, joined = (body_data(table, moved, body) for body in bodies)
            if remaining is None or joined is None:
                continue
            if count_channels(joined)[1] < second.redundant + MIN_REDUNDANT_CHANNELS:
                continue
            gain = first.nats + second.nats - _SWAP_PRIOR_NATS
            gain -= sum(_healthy_nats(table, moved, body) for body in bodies)
            if gain > _MIN_SWAP_GAIN_NATS and (best is None or gain > best[0]):
                best = gain, MovedSensor(moved, site, bodies, float(1 / (1 + np.exp(-gain))))
    return None if best is None else best[1]
