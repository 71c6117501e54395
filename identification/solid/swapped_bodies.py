"""Two sensors of different bodies, exchanged: both bodies look wrong, and neither is."""

from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from identification.solid.body_channels import Table, body_data
from identification.solid.fault_search import Search
from identification.solid.rigid_fit import Moments, fit
from identification.solid.sensor_faults import State
from identification.words import Campaign, node_of

# Nats before the data are seen: one campaign in a hundred, one pair in some hundreds.
_COST = 10.0
_CLEARLY = 3.0


@dataclass(frozen=True, eq=False)
class Crossed:
    """An exchange across bodies.

    Args:
        table: with the two sensors' channels exchanged.
        bodies: the two.
        location: ``sensor:acc1+acc7``.
        probability: beside what explains each body alone.
    """

    table: Table
    bodies: tuple[str, str]
    location: str
    probability: float


def crossed(table: Table, campaign: Campaign, found: list[Search]) -> Crossed | None:
    """The best exchange of two sensors, if it explains two bodies better than faults of each."""
    wrong = [one for one in found if one.taken or one.more]
    best: tuple[float, Crossed] | None = None
    for first, second in combinations(wrong, 2):
        alone = first.nats + second.nats
        for a, b in product(first.data.sensors.names, second.data.sensors.names):
            swapped = _swapped(table, a, b)
            if swapped is None:
                continue
            bodies = (first.data.body, second.data.body)
            gain = alone - _COST - sum(_nats(swapped, campaign, body) for body in bodies)
            if gain > _CLEARLY and (best is None or gain > best[0]):
                probability = float(1 / (1 + np.exp(-gain)))
                pair = "+".join(sorted((a, b), key=lambda name: (node_of(name) or 0, name)))
                best = gain, Crossed(swapped, bodies, f"sensor:{pair}", probability)
    return None if best is None else best[1]


def _swapped(table: Table, first: str, second: str) -> Table | None:
    """The table if each had read what the other did; None if their directions differ."""
    places = {dof: k for k, dof in enumerate(table.channels)}
    one = {dof.direction: k for dof, k in places.items() if dof.point == first}
    other = {dof.direction: k for dof, k in places.items() if dof.point == second}
    if one.keys() != other.keys():
        return None
    order = list(range(len(table.channels)))
    for direction, k in one.items():
        order[k], order[other[direction]] = other[direction], k
    return replace(
        table,
        values=table.values[:, :, order],
        variance=table.variance[:, :, order],
        measured=table.measured[:, order],
    )


def _nats(table: Table, campaign: Campaign, body: str) -> float:
    """Cost of a body without a fault."""
    data = body_data(table, campaign, body)
    if data is None:
        return 0.0
    fitted = fit(State.healthy(data, campaign.tolerance).model, Moments.of(data, blocks=1))
    return fitted.data + fitted.prior
