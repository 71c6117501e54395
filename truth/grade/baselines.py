"""What a campaign's files tell without any diagnosis: the judgements to be beaten.

Each baseline is a verdict like the software's and goes through the same marks:

* ``refit_only``: none if the refit's held-out excess is below 1.1, else unexplained.
* ``frac``, ``residual``, ``comac``: the output that agrees worst with the drawing. A rank tells a
  place and no effect, so each comes twice: ``_gain`` puts a sensor_gain at that sensor, ``_mass``
  a mass_error on the body that carries it.

All state their first choice with certainty.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType

from truth.errors import TruthError
from truth.grade.compare import DrawingComparison
from truth.grade.marks import SEEN, Excess
from truth.grade.verdict import CATALOGUE, EXPLAINED, NONE, STATED, UNEXPLAINED, Row, StatedVerdict
from truth.machine.station import AXES, Station

Output = tuple[int, int]  # node, axis 1, 2, 3
Ranking = Callable[[DrawingComparison], list[Output]]


def refit_only(excess: Excess) -> StatedVerdict:
    """Return the verdict of a refit that knows no effect.

    Raises:
        TruthError: there is none.
    """
    if excess.refit is None:
        raise TruthError("there is no refit.json")
    if excess.refit < SEEN:
        return StatedVerdict(NONE, none=1.0)
    return StatedVerdict(UNEXPLAINED, unexplained=1.0)


def by_frac(comparison: DrawingComparison) -> list[Output]:
    """Return the outputs by the FRAC of their channels, the worst first."""
    ordered = sorted(comparison.channels, key=lambda channel: channel.frac)
    return [(channel.node, channel.axis) for channel in ordered]


def by_residual(comparison: DrawingComparison) -> list[Output]:
    """Return the outputs by the relative residual of their channels, the largest first."""
    ordered = sorted(comparison.channels, key=lambda channel: -channel.residual)
    return [(channel.node, channel.axis) for channel in ordered]


def by_comac(comparison: DrawingComparison) -> list[Output]:
    """Return the outputs by their COMAC over all lines, the worst first."""
    known = comparison.coordinates
    return sorted(known, key=lambda output: known[output])


RANKINGS: Mapping[str, Ranking] = MappingProxyType(
    {"frac": by_frac, "residual": by_residual, "comac": by_comac}
)


def gain_verdict(comparison: DrawingComparison, ranking: Ranking) -> StatedVerdict:
    """Return a verdict that blames the sensors in their order, each by its worst direction."""
    worst: dict[str, str] = {}
    for node, axis in ranking(comparison):
        worst.setdefault(f"sensor:acc{node}", f"t{AXES[axis - 1]}")
    return _blame("sensor_gain", worst.items())


def mass_verdict(comparison: DrawingComparison, ranking: Ranking) -> StatedVerdict:
    """Return a verdict that blames the bodies in the order of their sensors."""
    carrier = {
        sensor.node: comparison.station.stages[index].name
        for index, sensor in comparison.station.sensors()
    }
    bodies = dict.fromkeys(f"body:{carrier[node]}" for node, _ in ranking(comparison))
    return _blame("mass_error", ((body, "") for body in bodies))


def list_places(station: Station, nodes: Sequence[int]) -> dict[str, list[str]]:
    """Return the places of a machine by their kind.

    Args:
        station: machine whose places are listed.
        nodes: nodes that the hammer hits.
    """
    names = [stage.name for stage in station.stages]
    hits = {hit.node for stage in station.stages for hit in stage.hit_points}
    return {
        "joint": [f"joint:{stage.name}" for stage in station.stages if stage.joints],
        "body": [f"body:{name}" for name in names],
        "sensor": sorted(f"sensor:acc{sensor.node}" for _, sensor in station.sensors()),
        "hammer": [f"hammer:{'hit' if node in hits else 'acc'}{node}" for node in nodes],
        "pair": [
            f"pair:{names[lower]}-{names[upper]}"
            for upper, stage in enumerate(station.stages)
            for lower in range(upper)
            if stage.parent != lower
        ],
    }


def hypotheses_of(comparison: DrawingComparison) -> dict[str, tuple[str, ...]]:
    """Return the places that each effect of the catalogue may have in a machine.

    Joints are those that move, for ``missing_dof`` those with a rigid direction; a swap has one
    sensor or two. Effects without any place are left out.
    """
    station = comparison.station
    places = list_places(station, comparison.nodes)
    sensors = [place.partition(":")[2] for place in places["sensor"]]
    hypotheses = {
        effect: tuple(places[entry.kind])
        for effect, entry in CATALOGUE.items()
        if effect not in STATED  # no campaign that is drawn has states
    }
    hypotheses["missing_dof"] = tuple(
        f"joint:{stage.name}" for stage in station.stages if len(stage.joints) < 6
    )
    hypotheses["sensor_swap"] += tuple(
        f"sensor:{first}+{second}" for i, first in enumerate(sensors) for second in sensors[i + 1 :]
    )
    return {effect: locations for effect, locations in hypotheses.items() if locations}


def _blame(effect: str, ranked: Iterable[tuple[str, str]]) -> StatedVerdict:
    rows = tuple(
        Row(effect, place, probability=0.0 if number else 1.0, dof=dof)
        for number, (place, dof) in enumerate(ranked)
    )
    where = tuple((row.location, None) for row in rows)
    return StatedVerdict(EXPLAINED, causes=rows, where=where)
