"""Campaigns of the scorecard: one fault, several or none, on machines of many kinds.

A design says what a campaign has; its row number and the first seed of the bench say all else. A
campaign that is drawn stays in a folder of its own, so that several engines diagnose the same
files, and drawing never counts as diagnosing. ``CAMPAIGNS`` in the environment names that folder.
"""

import json
import os
import tempfile
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, cycle, islice, product
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tests.helpers.any_machines import GANTRY, SERVO_AXIS
from truth import (
    Cause,
    Plan,
    Protocol,
    TruthError,
    VirtualCampaign,
    Wanted,
    draw_campaign,
    draw_protocol,
    read_station,
    write_answer,
    write_campaign,
)
from truth.campaign.case_design import fit_to_machine
from truth.campaign.draw import REAL_INSTRUMENTS, draw_hammers
from truth.effects.outside import OUTSIDE
from truth.machine.random_tree import draw_tree
from truth.machine.station import Station

ASSETS = Path(__file__).parents[2] / "assets"
STATION = ASSETS / "microstation" / "station.xml"
LEGS = ASSETS / "microstation" / "station_legs.xml"
MACHINES = {"gantry": GANTRY, "servo axis": SERVO_AXIS, "legs": ""}  # MJCF, where it is no asset
TREE = "tree"
LINEAR = (  # of the catalogue; the force channel has a cell of its own
    "appendage",
    "drift",
    "feedback_delay",
    "flexible_body",
    "gyroscopic",
    "hammer_misalignment",
    "inertance",
    "joint_coupling",
    "mass_error",
    "missing_dof",
    "mount_resonance",
    "parallel_path",
    "sensor_delay",
    "sensor_gain",
    "sensor_misalignment",
    "sensor_polarity",
    "sensor_position",
    "sensor_swap",
    "structural_damping",
    "support_loss",
    "viscoelastic",
)
UNSIZED = ("sensor_polarity", "sensor_swap")  # they are there or not: no ratio can be chosen
SIZED = tuple(name for name in LINEAR if name not in UNSIZED)
COMBINED = tuple(name for name in SIZED if name != "flexible_body")  # it hides all others
LAWS = ("friction", "backlash", "hardening")
LEVELS_N = (40.0, 200.0, 1000.0)
RETURNING_N = (*LEVELS_N, LEVELS_N[0])
QUIET_N = (5000.0,)  # hits so hard that the noise is a twenty-fifth of the usual
GAINS_WITHIN = (0.92, 0.95, 1.05, 1.08)
GAINS_BEYOND = (0.8, 0.86, 1.12, 1.18, 1.3)
DELAYS_S = (-1e-4, 1e-4, -2e-4, 2e-4, -5e-4)
TESTS = {  # what differs from a plain test
    "no coherence": {"coherence": False},
    "two hammer points": {},
    "short": {"lines": 401, "averages": 4},
}
TREE_EVERY = 4  # every so manyth machine of a pile is a random tree of stages
_CORRECTIONS = 3  # of a size for what the further steps of a refit hide
_DRAWS_OF_PLACE = 8  # for the ratio; few effects reach it beside much dirt, wherever they are
_RIGID = 2  # directions of every machine that are rigid, for one of them may be what is missing
_TRIES = 5  # seeds, until a machine has a place for its effects
_NEXT_SEED = 1_000  # from one try to the next: more than a bench has campaigns


@dataclass(frozen=True)
class Design:
    """What one campaign has.

    Args:
        cell: the row of the table that it counts in.
        effects: what the model lacks, the one that is graded first, first.
        ratio: survival ratio that each is made for.
        dirt: motion that small imperfections leave of a re-tuned machine [%].
        machine: ``station``, ``tree`` for random stages, or one of ``MACHINES``.
        parameter: of the force channel, name and value with its tolerance, instead of a ratio.
        levels: mean peak forces of the tests [N]; those of the drawn protocol if empty.
        test: one of ``TESTS``; drawn if empty.
    """

    cell: str
    effects: tuple[str, ...] = ()
    ratio: float | None = None
    dirt: float = 0.0
    machine: str = "station"
    parameter: tuple[str, float] | None = None
    levels: tuple[float, ...] = ()
    test: str = ""


@dataclass(frozen=True)
class Stored:
    """A campaign on disk.

    Args:
        folder: with ``campaign.toml``, without the answer.
        answer: the TOML; None if no machine had a place for the effects.
        seed: of the draw.
        seconds: core seconds that drawing it took.
    """

    folder: Path
    answer: str | None
    seed: int
    seconds: float

    @property
    def weakest_ratio(self) -> float | None:
        """Survival ratio of the fault that a refit hides most; None if none is stated."""
        if self.answer is None:
            return None
        answer = tomllib.loads(self.answer)
        ratios = [cause.get("ratio") for cause in answer.get("cause", [answer])]
        return None if None in ratios else min(ratios)

    @property
    def dirt_items(self) -> list[str]:
        """Effect and place of every small imperfection of the answer."""
        items = tomllib.loads(self.answer or "").get("dirt", {}).get("item", [])
        return sorted({f"{item['effect']}@{item['location']}" for item in items})


def reported_designs() -> tuple[Design, ...]:
    """Return the designs of the reported campaigns, so mixed that any first part is balanced."""
    piles = [
        _with_trees(_singles(f"dirt {dirt:g} %", dirt, ratio, count, start=number))
        for number, (dirt, ratio, count) in enumerate(
            ((5.0, 4.0, 40), (15.0, 4.0, 40), (5.0, 2.0, 40), (15.0, 2.0, 40), (30.0, 4.0, 20))
        )
    ]
    ratios = cycle((4.0, 2.0, 8.0))
    clean = [Design("clean", (name,), next(ratios)) for name in _turns(LINEAR, 100, 9)]
    piles += [
        _with_trees(clean),
        _with_trees([Design("nothing")] * 40),
        [Design("nothing, quiet", levels=QUIET_N)] * 20,
        [Design("nothing, mis-tuned")] * 20,
        _with_trees(_alone(45)),
        _with_trees(_forces(30)),
        *(_with_trees(_several(size, 20, start=5 + size)) for size in (2, 3)),
        *_levels(),
        [Design("outside the catalogue", (name,), 4.0) for name in _turns(OUTSIDE, 20, 3)],
    ]
    piles += [
        [Design(test, (name,), 4.0, test=test) for name in _turns(SIZED, 15, 20 + number)]
        for number, test in enumerate(TESTS)
    ]
    piles += [
        [
            Design(machine, () if name == "nothing" else (name,), 4.0, machine=machine)
            for name in _turns((*SIZED, "nothing", "nothing"), 15, 30 + number)
        ]
        for number, machine in enumerate(MACHINES)
    ]
    return interleave(piles)


def _singles(cell: str, dirt: float, ratio: float, count: int, start: int) -> list[Design]:
    return [Design(cell, (name,), ratio, dirt) for name in _turns(SIZED, count, start)]


def _alone(count: int) -> list[Design]:
    """Return campaigns that have nothing but small imperfections: 5, 15 and 30 % in turn."""
    return [Design("dirt alone", dirt=dirt) for dirt in islice(cycle((5.0, 15.0, 30.0)), count)]


def _forces(count: int) -> list[Design]:
    """Return faults of the force channel; every second machine has small imperfections too.

    Gains within and beyond what a diagnosis has to name, and delays, come in turn.
    """
    kinds = (
        cycle(("hammer_gain", "gain", gain) for gain in GAINS_WITHIN),
        cycle(("hammer_gain", "gain", gain) for gain in GAINS_BEYOND),
        cycle(("hammer_delay", "delay", delay) for delay in DELAYS_S),
    )
    faults = chain.from_iterable(zip(*kinds, strict=True))
    dirts = cycle((0.0, 5.0))
    return [
        Design("force channel", (effect,), dirt=next(dirts), parameter=(name, value))
        for effect, name, value in islice(faults, count)
    ]


def _several(size: int, count: int, start: int) -> list[Design]:
    """Return sets of effects at ratio 4, on exact machines and beside 5 % of dirt in turn."""
    sets = list(combinations(COMBINED, size))
    chosen = np.random.default_rng(start).permutation(len(sets))[:count]
    dirts = cycle((0.0, 5.0))
    return [Design(f"{size} effects", sets[k], 4.0, next(dirts)) for k in chosen.tolist()]


def _levels() -> list[list[Design]]:
    """Return laws of joints, drift between levels, and linear machines, all at three levels."""
    laws = [
        Design("law of a joint", (law,), 4.0, dirt, levels=LEVELS_N)
        for law, dirt in product(LAWS, (0.0, 5.0))
    ]
    drifts = [
        Design("drift between levels", ("level_drift",), levels=levels)
        for levels in (RETURNING_N, LEVELS_N)
    ]
    linear = [Design("linear at three levels", dirt=dirt, levels=LEVELS_N) for dirt in (0.0, 5.0)]
    return [laws * 5, drifts * 5, linear * 10]


def _turns(names: Sequence[str], count: int, start: int) -> list[str]:
    """Return names in turn, every turn in another order."""
    random = np.random.default_rng(start)
    names = tuple(names)
    turns = (names[k] for _ in range(count) for k in random.permutation(len(names)).tolist())
    return list(islice(turns, count))


def _with_trees(pile: Sequence[Design]) -> list[Design]:
    """Return a pile in which every fourth machine is a random tree."""
    return [
        replace(design, machine=TREE) if number % TREE_EVERY == 1 else design
        for number, design in enumerate(pile)
    ]


def interleave(piles: Sequence[Sequence[Design]]) -> tuple[Design, ...]:
    """Return the designs of all piles so mixed that any first part holds some of every pile."""
    order = [
        (place / len(pile), number, design)
        for number, pile in enumerate(piles)
        for place, design in enumerate(pile)
    ]
    return tuple(design for _, _, design in sorted(order, key=lambda entry: entry[:2]))


def draw(design: Design, seed: int) -> VirtualCampaign:
    """Draw the campaign of a design.

    Raises:
        TruthError: the machine has no place for its effects.
    """
    with threadpool_limits(1):  # more threads round otherwise: the bytes would be others
        return draw_campaign(*plan_campaign(design, seed))


def plan_campaign(design: Design, seed: int) -> tuple[Station, Plan]:
    """Return the nominal machine of a design, and the plan by which its campaign is drawn."""
    station = _station(design.machine, seed)
    parameter = beside_tolerance(design, seed)
    wanted = tuple(
        Wanted(name, None, design.ratio, _CORRECTIONS, parameter, _DRAWS_OF_PLACE)
        for name in design.effects
    )
    plan = Plan(
        seed,
        Cause(wanted, mistuned=design.cell == "nothing, mis-tuned", kind=design.cell),
        _protocol(design, station, seed),
        REAL_INSTRUMENTS,
        rigid=_RIGID,
        dirt=design.dirt,
    )
    return station, plan


def _station(machine: str, seed: int) -> Station:
    if machine == TREE:
        return draw_tree(seed)
    if not MACHINES.get(machine):
        return read_station(LEGS if machine == "legs" else STATION)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "machine.xml"
        path.write_text(MACHINES[machine], encoding="utf-8")
        return read_station(path)


def _protocol(design: Design, station: Station, seed: int) -> Protocol:
    protocol = draw_protocol(station, seed)
    if design.test:
        nodes = sorted(sensor.node for _, sensor in station.sensors())
        count = 2 if design.test == "two hammer points" else 1
        points = np.random.default_rng(seed).permutation(nodes)[:count].tolist()
        protocol = replace(Protocol(tuple(points)), **TESTS[design.test])
    if design.levels:
        protocol = replace(protocol, levels=design.levels)
    return fit_to_machine(protocol, station) if design.machine in MACHINES else protocol


def beside_tolerance(design: Design, seed: int) -> tuple[str, float] | None:
    """Return the parameter of the effect alone, without what the force channel is off anyway.

    Gains multiply and delays add, so that both together are what the design asks for.
    """
    if design.parameter is None:
        return None
    name, value = design.parameter
    (hammer, *_) = draw_hammers(read_station(STATION), 11, REAL_INSTRUMENTS, seed)  # any point
    return name, value / hammer.gain if name == "gain" else value - hammer.delay


def campaigns_folder() -> Path:
    """Return the folder in which drawn campaigns stay; git ignores the usual one."""
    usual = Path(__file__).parents[2] / "build" / "scorecard"
    return Path(os.environ.get("CAMPAIGNS") or usual)


def ensure(design: Design, seed: int) -> Stored:
    """Return a campaign of the folder; it is drawn if it is not there."""
    place = campaigns_folder() / f"{seed}"
    record = place / "draw.json"  # written last: without it the campaign is not whole
    if not record.is_file():
        _store(design, seed, place, record)
    told = json.loads(record.read_text("utf-8"))
    answer = place / "answer.toml"
    text = answer.read_text("utf-8") if told["drawn"] else None
    return Stored(place / "campaign", text, told["seed"], told["seconds"])


def _store(design: Design, seed: int, place: Path, record: Path) -> None:
    """Draw a campaign; of machines without a place for its effects the next one is tried."""
    began, drawn, used = time.process_time(), None, seed
    for turn in range(_TRIES):
        used = seed + turn * _NEXT_SEED
        try:
            drawn = draw(design, used)
            break
        except TruthError as error:
            reason = str(error)
            if "is unknown" in reason:  # of this version of the project, not of the machine
                raise
    place.mkdir(parents=True, exist_ok=True)
    if drawn is not None:
        write_campaign(drawn, place / "campaign", overwrite=True, sealed=True)
        write_answer(drawn, place / "answer.toml")
    seconds = time.process_time() - began
    told = {"seed": used, "drawn": drawn is not None, "seconds": seconds}
    record.write_text(json.dumps(told), encoding="utf-8")
