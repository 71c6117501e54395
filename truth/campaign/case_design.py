"""Which cases a blind test is made of: a shuffled deck, so that every cause comes equally often.

A case's number and the seed say all about it, so that an interrupted test goes on where it was.
Machine and protocol come from the case's own seed, whatever its cause is.

The band and the level of a test that fit a machine: its own modes, and its mass.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import scipy.linalg

from truth.campaign.cause import Cause, Wanted
from truth.campaign.draw import Tolerances, draw_basis, draw_rigid
from truth.campaign.place_names import WHOLE_DECK, Choice, OwnTest, find_place
from truth.campaign.protocol import Protocol, draw_protocol, occasions, takes
from truth.campaign.virtual_test import Plan, VirtualCampaign, draw_campaign
from truth.effects import CATALOGUE, Scene
from truth.effects.outside import OUTSIDE
from truth.errors import NoPlaceError, TruthError
from truth.machine.random_tree import draw_tree
from truth.machine.rig import Prepared, build, null_basis
from truth.machine.station import Real, Station
from truth.random_streams import stream

RATIOS = (1.0, 2.0, 4.0, 8.0)
RIGID = 2  # directions of every machine that are rigid, for one of them may be what is missing
_NOTHING_CARDS, _MISTUNED_CARDS, _PAIR_CARDS, _MANY_CARDS = 4, 2, 2, 1  # of each in a round
_SMALL = (0.2, 0.6)  # survival ratios of the small ones behind a large one
_MANY_SMALL = (3, 6)
_TWINS = (
    ("structural_damping", "viscoelastic", "joint"),
    ("mass_error", "appendage", "body"),
    ("joint_coupling", "support_loss", "joint"),
    ("feedback_delay", "structural_damping", "joint"),
    ("sensor_misalignment", "sensor_position", "sensor"),
    ("friction", "hardening", "joint"),
)
# The decks' plans have no force channel at work, and their cases stay those of earlier results.
_NOT_IN_DECK = ("none", "hammer_gain", "hammer_delay", "hammer_position")
_WITHOUT_SIZE = ("sensor_polarity", "sensor_swap")  # never small
_TRIES = 20  # causes, until one has a place in the machine


@dataclass(frozen=True)
class Card:
    """One case of a round.

    Args:
        kind: ``nothing``, ``mistuned``, ``one``, ``twin``, ``two``, ``many`` or ``outside``.
        names: of the effects, the first the largest.
        ratio: survival ratio of the first.
        shared: twins have the number of their pair, and with it their machine.
        place: kind of place that twins share.
        twins: both names of a pair: the place must do for either.
        location: place of the first that the user chose.
        parameter: of the answer that sets the size, and its value, if the user chose it.
    """

    kind: str
    names: tuple[str, ...] = ()
    ratio: float = 0.0
    shared: int | None = None
    place: str = ""
    twins: tuple[str, ...] = ()
    location: str = ""
    parameter: tuple[str, float] | None = None


@dataclass(frozen=True, eq=False)
class DrawnCase:
    """A case as drawn.

    Args:
        number: in the test.
        plan: how its campaign was made.
        station: nominal machine of it.
        campaign: files and answer.
    """

    number: int
    plan: Plan
    station: Station
    campaign: VirtualCampaign


def draw_case(
    nominal: Station | None,
    seed: int,
    number: int,
    choice: Choice = WHOLE_DECK,
    user_test: OwnTest | None = None,
) -> DrawnCase:
    """Draw a case of a blind test.

    Args:
        nominal: the machine; None: a random tree for every case.
        seed: of the whole test.
        number: of the case, from 0.
        choice: effects, places and sizes that the user chose.
        user_test: the user's own test of his own model; None for a test that is drawn.

    Raises:
        TruthError: the machine has no place for what is wanted.
    """
    card = next(islice(deal_cards(seed, choice), number, None))
    key = (1, number) if card.shared is None else (2, card.shared)
    words = np.random.SeedSequence(seed, spawn_key=key).generate_state(4)  # too many to be tried
    machine = int.from_bytes(words.tobytes(), "little")
    station = nominal or draw_tree(machine)
    protocol = draw_protocol(station, machine) if user_test is None else user_test.protocol
    if station.source is not None and user_test is None:
        protocol = fit_to_machine(protocol, station)
    for turn in range(_TRIES):
        random = stream(machine, f"cause.{turn}")
        cause = _cause(card, station, random, turn)
        plan = Plan(
            machine,
            cause,
            protocol,
            Tolerances() if user_test is None else user_test.tolerance,
            rigid=RIGID,
            dirt=choice.dirt,
            as_drawn=user_test is not None,
        )
        if card.twins and not _do_for_both(card, cause, station, protocol, machine):
            continue
        try:
            return DrawnCase(number, plan, station, draw_campaign(station, plan))
        except NoPlaceError:
            if choice.is_made:
                raise
    raise NoPlaceError(f"{station.name}: none of {_TRIES} causes has a place in it")


def deal_cards(seed: int, choice: Choice = WHOLE_DECK) -> Iterator[Card]:
    """Go through the cases of a blind test, round after round, without end."""
    if choice.is_made:
        for chosen in choice.rounds(seed, RATIOS):
            if chosen is None:
                yield Card("nothing")
            else:
                effect, place, ratio = chosen
                yield Card("one", (effect,), ratio, location=place, parameter=choice.parameter)
    turn, pair = 0, 0
    while True:
        random = stream(seed, f"deck.{turn}")
        cards: list[list[Card]] = [[Card("nothing")] for _ in range(_NOTHING_CARDS)]
        cards += [[Card("mistuned")] for _ in range(_MISTUNED_CARDS)]
        catalogue = [name for name in CATALOGUE if name not in _NOT_IN_DECK]
        for kind, names in (("one", catalogue), ("outside", list(OUTSIDE))):
            # The four ratios in turn for each effect; with which it starts, the seed says.
            start = stream(seed, f"deck.{kind}").integers(len(RATIOS), size=len(names))
            cards += [
                [Card(kind, (name,), RATIOS[(turn + first) % len(RATIOS)])]
                for name, first in zip(names, start.tolist(), strict=True)
            ]
        for _ in range(_PAIR_CARDS):
            cards.append([Card("two", _several(random, catalogue, 2), _ratio(random))])
        sized = [name for name in catalogue if name not in _WITHOUT_SIZE]
        for _ in range(_MANY_CARDS):
            count = 1 + int(random.integers(_MANY_SMALL[0], _MANY_SMALL[1] + 1))
            cards.append([Card("many", _several(random, sized, count), _ratio(random))])
        first_twin, second_twin, place = _TWINS[int(random.integers(len(_TWINS)))]
        ratio, pair = _ratio(random), pair + 1
        twins = (first_twin, second_twin)
        cards.append([Card("twin", (name,), ratio, pair, place, twins) for name in twins])
        for number in random.permutation(len(cards)).tolist():
            yield from cards[number]
        turn += 1


def _do_for_both(card: Card, cause: Cause, station: Station, protocol: Protocol, seed: int) -> bool:
    """Whether either twin has its place in the machine: else another place is drawn for both."""
    basis = station
    if station.source is None and protocol.measured is None:
        basis = draw_rigid(draw_basis(station, seed), RIGID, seed)
    scene = Scene(basis, occasions(protocol, takes(protocol, basis, seed)))
    for name in card.twins:
        try:
            if CATALOGUE[name](stream(seed, "twin"), scene, cause.wanted[0].place) is None:
                return False
        except TruthError:
            return False
    return True


def _several(random: np.random.Generator, names: list[str], count: int) -> tuple[str, ...]:
    return tuple(names[i] for i in random.permutation(len(names))[:count].tolist())


def _ratio(random: np.random.Generator) -> float:
    return float(random.choice(RATIOS))


def _cause(card: Card, station: Station, random: np.random.Generator, turn: int) -> Cause:
    if card.kind in ("nothing", "mistuned"):
        return Cause(mistuned=card.kind == "mistuned", kind=card.kind)
    names, place = card.names, find_place(card.location, station) or None
    if card.kind == "twin":
        stage = station.stages[int(random.integers(len(station.stages)))]
        node = stage.sensors[0].node if stage.sensors else 0
        place = f"sensor:acc{node}" if card.place == "sensor" else f"{card.place}:{stage.name}"
    elif turn:  # the machine has no place for it: another effect of the same kind
        among = OUTSIDE if card.kind == "outside" else CATALOGUE
        never = (*_NOT_IN_DECK, *(_WITHOUT_SIZE if card.kind == "many" else ()))
        names = _several(random, [name for name in among if name not in never], len(names))
    first = Wanted(names[0], place, card.ratio or None, parameter=card.parameter)
    if card.kind == "two":
        return Cause((first, Wanted(names[1], None, card.ratio)), kind=card.kind)
    small = (Wanted(name, None, random.uniform(*_SMALL)) for name in names[1:])
    return Cause((first, *small), kind=card.kind)


# A usual station, of this mass, is tested to 200 Hz at 200 N.
_BAND_HZ = 200.0
_MASS_KG = 3735.0
_MODES = 12  # in the band, or half of them
_BEYOND_MODE = 1.2
_COARSE = 8  # lines below the first mode: with fewer the lines are twice as many
_STILL = 1e-4  # of the median mode: below it nothing holds the machine
_DIGITS = 2  # of spacing and level


def natural_frequencies(station: Station) -> Real:
    """Return the undamped natural frequencies [Hz], rising; motions that nothing holds have 0."""
    equations = build(Prepared(station, ())).equations
    basis = null_basis(equations)
    stiffness, mass = (basis.T @ matrix @ basis for matrix in (equations.stiffness, equations.mass))
    values = np.asarray(scipy.linalg.eigvalsh(stiffness, mass), np.float64)
    return np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)


def fit_to_machine(protocol: Protocol, station: Station) -> Protocol:
    """Return the test with band, hits and levels that fit a machine.

    The band ends a fifth above the twelfth mode, or the middle one of more than 24, or the last one
    of fewer than 12. Levels grow with the mass, so that all machines are shaken alike.

    Args:
        protocol: for a usual station.
    """
    modes = natural_frequencies(station)
    held = modes[modes > _STILL * np.median(modes)]
    if not held.size:
        return protocol
    top = _BEYOND_MODE * held[min(max(_MODES, held.size // 2), held.size) - 1]
    spacing, lines = protocol.resolution_hz * top / _BAND_HZ, protocol.lines
    if spacing * _COARSE > held[0]:
        spacing, lines = spacing / 2, 2 * lines - 1
    mass = sum(stage.mass for stage in station.stages)
    return replace(
        protocol,
        resolution_hz=_round(spacing),
        lines=lines,
        levels=tuple(_round(level * mass / _MASS_KG) for level in protocol.levels),
        scale=_round(top / _BAND_HZ),
    )


def _round(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
