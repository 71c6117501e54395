"""Names of places: sites as the model names them, and ``acc<node>``, as effects are drawn.

What a user wants to be drawn: effects, places and sizes of his choice, in his own test.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from truth.campaign.draw import Tolerances
from truth.campaign.protocol import Protocol, occasions, takes
from truth.effects import Scene
from truth.effects.other_packages import known_effects
from truth.effects.parallel_path import WORLD
from truth.errors import NoPlaceError, TruthError
from truth.machine.station import Station
from truth.random_streams import stream

_SURE_NOTHING = 5  # chosen cases for one with nothing


@dataclass(frozen=True)
class Choice:
    """Effects, places and sizes that are drawn.

    Args:
        effects: names; empty for all of the deck.
        places: locations such as ``joint:ty``; empty for a place that is drawn.
        ratios: survival ratios; empty for 1, 2, 4 and 8.
        parameter: name and value of the parameter of the answer that sets the size, instead.
        dirt: part of the motion that small imperfections leave of a re-tuned machine, in per cent.
    """

    effects: tuple[str, ...] = ()
    places: tuple[str, ...] = ()
    ratios: tuple[float, ...] = ()
    parameter: tuple[str, float] | None = None
    dirt: float = 0.0

    @property
    def is_made(self) -> bool:
        """Whether effects, places or sizes are chosen, instead of the whole deck."""
        return bool(self.effects)

    def rounds(
        self, seed: int, usual: tuple[float, ...]
    ) -> Iterator[tuple[str, str, float] | None]:
        """Go through effect, place and ratio of the cases, shuffled, round after round.

        One in six cases has no effect: None.

        Args:
            seed: of the whole test.
            usual: ratios that are drawn if none are chosen.
        """
        ratios = (0.0,) if self.parameter else self.ratios or usual
        chosen = list(product(self.effects, self.places or ("",), ratios))
        cards: list[tuple[str, str, float] | None] = [*chosen] * _SURE_NOTHING
        cards += [None] * len(chosen)
        turn = 0
        while True:
            random = stream(seed, f"chosen.{turn}")
            for number in random.permutation(len(cards)).tolist():
                yield cards[number]
            turn += 1


WHOLE_DECK = Choice()


@dataclass(frozen=True, eq=False)
class OwnTest:
    """The user's own test of his own model.

    Args:
        protocol: with what was measured.
        tolerance: of his campaign.
    """

    protocol: Protocol
    tolerance: Tolerances


_N_SHOWN = 12  # places in a sentence


def named_place(location: str, station: Station) -> str:
    """Return a location with the model's own names of sites instead of ``acc<node>``."""
    kind, _, place = location.partition(":")
    if kind not in ("sensor", "hammer"):
        return location
    return f"{kind}:" + re.sub(r"\bacc(\d+)\b", lambda match: station.site(int(match[1])), place)


def named_direction(dof: str, station: Station) -> str:
    """Return a direction, or the label of a test, with the model's own names of sites."""
    return re.sub(r"\bacc(\d+)(?=:)", lambda match: station.site(int(match[1])), dof)


def find_place(place: str, station: Station) -> str:
    """Return a place that the user names, with ``acc<node>`` for the model's own names of sites.

    Args:
        place: such as ``joint:ty`` or ``sensor:front_acc3``; a name without its kind stays as it
            is, and so does a place of a kind that another package may know.
        station: the nominal machine.

    Raises:
        TruthError: the machine has no such place.
    """
    kind, _, name = place.rpartition(":")
    nodes = {sensor.site: f"acc{sensor.node}" for _, sensor in station.sensors()}
    bodies = [stage.name for stage in station.stages]
    hits = [f"hit{hit.node}" for stage in station.stages for hit in stage.hit_points]
    names = {
        "body": bodies,
        "joint": bodies,
        "sensor": list(nodes),
        "hammer": [*nodes, *hits, *(motor.name for motor in station.motors)],
        "pair": [
            f"{lower}-{upper}" for lower in (*bodies, WORLD) for upper in bodies if lower != upper
        ],
    }
    parts = name.split("+") if kind == "sensor" else [name]
    for part in (nodes.get(part, part) for part in parts):
        if kind in names and part not in {*names[kind], *nodes.values()}:
            shown = [f"{kind}:{name}" for name in names[kind]]
            more = " ..." if len(shown) > _N_SHOWN else ""
            raise TruthError(
                f"place {place!r}: the machine has none; it has {', '.join(shown[:_N_SHOWN])}{more}"
            )
    if kind not in ("sensor", "hammer"):
        return place
    return f"{kind}:" + "+".join(nodes.get(part, part) for part in parts)


def check_choice(choice: Choice, station: Station, protocol: Protocol) -> None:
    """Refuse places that the machine lacks, and effects at places of another kind.

    Args:
        choice: what the user chose.
        station: the nominal machine.

    Raises:
        TruthError: a place is none, or none of an effect.
    """
    places = [find_place(place, station) for place in choice.places]
    scene = Scene(station, occasions(protocol, takes(protocol, station, 0)), protocol.pace)
    for name in choice.effects:
        try:
            effect = known_effects()[name](stream(0, "kind"), scene, None)
        except NoPlaceError:
            continue  # in this test; each case says so
        if effect is None or not effect.answer().location:
            continue
        kind = effect.answer().location.partition(":")[0]
        for place in places:
            if place.rpartition(":")[0] not in ("", kind):
                raise TruthError(
                    f"{name} cannot sit at {place!r}: name places as {kind}:<name>, and test "
                    "effects of other places by calls of their own"
                )
