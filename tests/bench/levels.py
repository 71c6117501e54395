"""The diagnosis of joints that depend on the level: friction, backlash, hardening, three levels.

Campaigns of withheld truth, whose joints are integrated in time by ``truth`` itself: ten of each
effect on exact machines and ten beside 5 % of small imperfections, at survival ratio 4, and 60
linear machines at three levels. Seeds 440000 and up tuned nothing. Rows that are done are kept, in
an order that mixes all cells. The environment is that of the bench of real machines (``dirty``):
``LIMIT``, ``CAMPAIGNS``, ``JOBS``.
"""

import os
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tests.bench.dirty import diagnosed, dirt_items
from tests.bench.dirty_campaigns import STATION, Stored, campaigns_folder, interleave
from tests.bench.dirty_rates import graded, has_wrong_cause
from tests.bench.kept import cases, of
from truth import (
    Cause,
    Plan,
    TruthError,
    Wanted,
    draw_campaign,
    draw_protocol,
    read_station,
    write_answer,
    write_campaign,
)
from truth.campaign.draw import REAL_INSTRUMENTS
from truth.grade.beside_background import right_first
from truth.grade.rates import wilson

FIRST = 440_000
EFFECTS = ("friction", "backlash", "hardening")
LEVELS_N = (40.0, 200.0, 1000.0)
RATIO = 4.0
CAUSES_OF_EACH, LINEAR_MACHINES = 10, 60
_CORRECTIONS, _DRAWS_OF_PLACE, _RIGID = 3, 8, 2  # as in ``dirty_campaigns``


@dataclass(frozen=True)
class LevelDesign:
    """What one campaign has.

    Args:
        effect: what the joint does; None for a linear machine.
        dirt: motion that small imperfections leave of a re-tuned machine [%].
    """

    effect: str | None
    dirt: float

    @property
    def cell(self) -> str:
        """Group that it counts in."""
        return f"{self.effect or 'linear'}, dirt {self.dirt:g} %"


def designs() -> tuple[LevelDesign, ...]:
    """Return all designs, so mixed that any first part is balanced."""
    piles = [
        [LevelDesign(effect, dirt)] * CAUSES_OF_EACH for effect in EFFECTS for dirt in (0.0, 5.0)
    ]
    piles.append([LevelDesign(None, dirt) for dirt in islice(cycle((0.0, 5.0)), LINEAR_MACHINES)])
    return interleave(piles)  # type: ignore[arg-type, return-value]


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the figures of all rows."""
    limit = int(os.environ.get("LIMIT", len(designs())))
    jobs = int(os.environ.get("JOBS", "2"))
    cases(f"levels.{FIRST}", range(min(limit, len(designs()))), _case, jobs)
    return figures(list(of(f"levels.{FIRST}").values()))


def figures(rows: Sequence[dict]) -> list[dict[str, object]]:
    """Return rates, errors of the parameters and times of rows."""
    found: list[dict[str, object]] = []
    for cell in sorted({row["cell"] for row in rows}):
        read = [case for row in rows if row["cell"] == cell and (case := graded(row)) is not None]
        if cell.startswith("linear"):
            found.append(_rate(cell, "a wrong cause with p of 0.5 or more", read, has_wrong_cause))
            continue

        def is_first(case) -> bool:
            return right_first(case.truth, case.verdict)

        found.append(_rate(cell, "effect and joint first", read, is_first))
        found += _parameter_errors(cell, [case.row for case in read if is_first(case)])
        closed = [case.row["verdict"]["gap"]["closed"] for case in read if is_first(case)]
        known = [value for value in closed if value is not None]
        if known:
            figure = {"figure": f"{cell}: part of the gap closed, median"}
            found.append(figure | {"value": float(np.median(known)), "n": len(known)})
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    if seconds:
        for name, value in (("median", np.median(seconds)), ("largest", max(seconds))):
            figure = {"figure": f"core seconds, {name}", "value": float(value)}
            found.append(figure | {"n": len(seconds)})
    return found


def _rate(
    cell: str, words: str, read: Sequence, mark: Callable[[object], bool]
) -> dict[str, object]:
    hits, count = sum(map(mark, read)), len(read)
    low, high = wilson(hits, count)
    return {
        "figure": f"{cell}: {words}, %",
        "value": 100 * hits / max(count, 1),
        "n": f"{count} [{100 * low:.1f}, {100 * high:.1f}]",
    }


def _parameter_errors(cell: str, rows: Sequence[dict]) -> list[dict[str, object]]:
    """Return the median relative error of each parameter that the answer states."""
    errors: dict[str, list[float]] = {}
    for row in rows:
        truth = tomllib.loads(row["answer"])["parameters"]
        stated = row["verdict"]["causes"][0]["parameters"]
        for name, value in truth.items():
            if stated.get(name) is not None:
                errors.setdefault(name, []).append(abs(stated[name] / value - 1))
    return [
        {
            "figure": f"{cell}: error of {name}, median, %",
            "value": 100 * float(np.median(values)),
            "n": len(values),
        }
        for name, values in sorted(errors.items())
    ]


def _case(number: int) -> dict[str, object]:
    """Diagnose the campaign of a design, which is drawn before if it is not there."""
    design, seed = designs()[number], FIRST + number
    row: dict[str, object] = {"seed": seed, "cell": design.cell, "dirt": design.dirt}
    row |= {"effects": [design.effect] if design.effect else [], "drawn_ratio": None}
    try:
        folder, answer = _ensure(design, seed)
    except TruthError as error:
        return row | {"left_out": str(error)}
    plain = answer.partition("\n[dirt]")[0]
    stored = Stored(folder, answer, seed, 0.0)
    return row | {"answer": plain, "items": dirt_items(answer)} | diagnosed(stored)


def _ensure(design: LevelDesign, seed: int) -> tuple[Path, str]:
    """Return folder and answer of a campaign; it is drawn if it is not there."""
    place = campaigns_folder() / f"levels_{seed}"
    answer = place / "answer.toml"
    if not answer.is_file():
        station = read_station(STATION)
        protocol = replace(draw_protocol(station, seed), levels=LEVELS_N)
        wanted = ()
        if design.effect is not None:
            wanted = (Wanted(design.effect, None, RATIO, _CORRECTIONS, None, _DRAWS_OF_PLACE),)
        plan = Plan(
            seed,
            Cause(wanted, kind="single" if wanted else "none"),
            protocol,
            REAL_INSTRUMENTS,
            rigid=_RIGID,
            dirt=design.dirt,
        )
        with threadpool_limits(1):  # more threads round otherwise: the bytes would be others
            campaign = draw_campaign(station, plan)
        place.mkdir(parents=True, exist_ok=True)
        write_campaign(campaign, place / "campaign", overwrite=True, sealed=True)
        write_answer(campaign, answer)  # written last: without it the campaign is not whole
    return place / "campaign", answer.read_text("utf-8")
