"""Campaigns of real machines: one fault, or several, beside instruments and small imperfections.

A design says what a campaign has; its row number and the first seed of the bench say all else. A
campaign that is drawn stays in a folder of its own, so that several engines diagnose the same
files, and drawing never counts as diagnosing. ``CAMPAIGNS`` in the environment names that folder.
"""

import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, cycle, islice
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from truth import (
    Cause,
    Plan,
    TruthError,
    VirtualCampaign,
    Wanted,
    draw_campaign,
    draw_protocol,
    read_station,
    write_answer,
    write_campaign,
)
from truth.campaign.draw import REAL_INSTRUMENTS, draw_hammers
from truth.machine.random_tree import draw_tree

STATION = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"
LINEAR = (  # of the catalogue; the force channel has a cell of its own
    "appendage",
    "drift",
    "feedback_delay",
    "flexible_body",
    "gyroscopic",
    "hammer_misalignment",
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
GAINS_WITHIN = (0.92, 0.95, 1.05, 1.08)
GAINS_BEYOND = (0.8, 0.86, 1.12, 1.18, 1.3)
DELAYS_S = (-1e-4, 1e-4, -2e-4, 2e-4, -5e-4)
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
        tree: whether the machine is a random tree of stages instead of the station.
        parameter: of the force channel, name and value with its tolerance, instead of a ratio.
        levels: mean peak forces of the tests [N]; those of the drawn protocol if empty.
    """

    cell: str
    effects: tuple[str, ...] = ()
    ratio: float | None = None
    dirt: float = 0.0
    tree: bool = False
    parameter: tuple[str, float] | None = None
    levels: tuple[float, ...] = ()


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


def reported_designs() -> tuple[Design, ...]:
    """Return the designs of the reported campaigns, so mixed that any first part is balanced."""
    piles = [
        _singles("single", dirt, ratio, repeats=4, start=number)
        for number, (dirt, ratio) in enumerate(((5.0, 4.0), (15.0, 4.0), (5.0, 2.0), (15.0, 2.0)))
    ]
    piles.append(_singles("single", 30.0, 4.0, repeats=1, start=4))
    piles.append(alone("alone", 60))
    piles.append(forces("force", 40))
    piles += [several("several", size, 20, start=5 + size) for size in (2, 3)]
    ratios = cycle((4.0, 2.0, 8.0))
    piles.append([Design("clean", (name,), next(ratios)) for name in _turns(LINEAR, 100, 9)])
    piles.append([Design("nothing")] * 60)
    return interleave([_with_trees(pile) for pile in piles])


def _singles(cell: str, dirt: float, ratio: float, repeats: int, start: int) -> list[Design]:
    names = _turns(SIZED, repeats * len(SIZED), start)
    return [Design(cell, (name,), ratio, dirt) for name in names]


def alone(cell: str, count: int) -> list[Design]:
    """Return campaigns that have nothing but small imperfections: 5, 15 and 30 % in turn."""
    return [Design(cell, dirt=dirt) for dirt in islice(cycle((5.0, 15.0, 30.0)), count)]


def forces(cell: str, count: int) -> list[Design]:
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
        Design(cell, (effect,), dirt=next(dirts), parameter=(name, value))
        for effect, name, value in islice(faults, count)
    ]


def several(cell: str, size: int, count: int, start: int) -> list[Design]:
    """Return sets of effects at ratio 4, on exact machines and beside 5 % of dirt in turn."""
    sets = list(combinations(COMBINED, size))
    chosen = np.random.default_rng(start).permutation(len(sets))[:count]
    dirts = cycle((0.0, 5.0))
    return [Design(cell, sets[number], 4.0, next(dirts)) for number in chosen.tolist()]


def _turns(names: Sequence[str], count: int, start: int) -> list[str]:
    """Return names in turn, every turn in another order."""
    random = np.random.default_rng(start)
    turns = (names[k] for _ in range(count) for k in random.permutation(len(names)).tolist())
    return list(islice(turns, count))


def _with_trees(pile: Sequence[Design]) -> list[Design]:
    """Return a pile in which every fourth machine is a random tree."""
    return [
        Design(d.cell, d.effects, d.ratio, d.dirt, number % TREE_EVERY == 1, d.parameter)
        for number, d in enumerate(pile)
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
    station = draw_tree(seed) if design.tree else read_station(STATION)
    parameter = beside_tolerance(design, seed)
    wanted = tuple(
        Wanted(name, None, design.ratio, _CORRECTIONS, parameter, _DRAWS_OF_PLACE)
        for name in design.effects
    )
    protocol = draw_protocol(station, seed)
    if design.levels:
        protocol = replace(protocol, levels=design.levels)
    plan = Plan(
        seed,
        Cause(wanted, kind=design.cell),
        protocol,
        REAL_INSTRUMENTS,
        rigid=_RIGID,
        dirt=design.dirt,
    )
    with threadpool_limits(1):  # more threads round otherwise: the bytes would be others
        return draw_campaign(station, plan)


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
    usual = Path(__file__).parents[2] / "build" / "dirty_campaigns"
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
