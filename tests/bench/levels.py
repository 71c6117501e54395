"""The diagnosis of joints that depend on the level: friction, backlash, hardening, three levels.

Campaigns of withheld truth, whose joints are integrated in time by ``truth`` itself: ten of each
effect on exact machines and ten beside 5 % of small imperfections, at survival ratio 4, and 60
linear machines at three levels. In 20 further ones a joint drifts between the levels; in half of
these the first level is repeated. Seeds 441000 and up tuned nothing; that an earlier
engine failed at 441002, 441003 and 441026 led to mends. Rows that are done are kept,
in an order that mixes all cells. The environment is that of the bench of real machines
(``dirty``): ``LIMIT``, ``CAMPAIGNS``, ``JOBS``.
"""

import os
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import cycle, islice

import numpy as np

from tests.bench.dirty import describe_commit, diagnosed, dirt_items
from tests.bench.dirty_campaigns import Design, ensure, interleave
from tests.bench.dirty_rates import Graded, graded, has_wrong_cause
from tests.bench.kept import cases, of
from truth.grade.beside_background import right_first
from truth.grade.rates import wilson

FIRST = 441_000
EFFECTS = ("friction", "backlash", "hardening")
LEVELS_N = (40.0, 200.0, 1000.0)
RETURNING_N = (*LEVELS_N, LEVELS_N[0])
RATIO = 4.0
CAUSES_OF_EACH, LINEAR_MACHINES = 10, 60
RETURNS, STAYS = "drift, the first level repeated", "drift, no level repeated"


def designs() -> tuple[Design, ...]:
    """Return all designs, so mixed that any first part is balanced."""
    piles = [
        [Design(f"{effect}, dirt {dirt:g} %", (effect,), RATIO, dirt, levels=LEVELS_N)]
        * CAUSES_OF_EACH
        for effect in EFFECTS
        for dirt in (0.0, 5.0)
    ]
    piles += [
        [Design(cell, ("level_drift",), levels=levels)] * CAUSES_OF_EACH
        for cell, levels in ((RETURNS, RETURNING_N), (STAYS, LEVELS_N))
    ]
    linear = (
        Design(f"linear, dirt {dirt:g} %", dirt=dirt, levels=LEVELS_N) for dirt in cycle((0.0, 5.0))
    )
    return interleave([*piles, list(islice(linear, LINEAR_MACHINES))])


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the figures of all rows."""
    limit = int(os.environ.get("LIMIT", len(designs())))
    jobs = int(os.environ.get("JOBS", "2"))
    cases(f"levels.{FIRST}", range(min(limit, len(designs()))), _case, jobs)
    return figures(list(of(f"levels.{FIRST}").values()))


def figures(rows: Sequence[dict]) -> list[dict[str, object]]:
    """Return rates, errors of the parameters and times of rows."""
    found: list[dict[str, object]] = []
    for dirt in dict.fromkeys(row["dirt"] for row in rows):
        kinds = [f"{law}, dirt {dirt:g} %" for law in EFFECTS]
        read = [case for row in rows if row["cell"] in kinds and (case := graded(row)) is not None]
        found.append(_rate(f"all laws, dirt {dirt:g} %", "effect and joint first", read, _is_first))
    for cell in sorted({row["cell"] for row in rows}):
        read = [case for row in rows if row["cell"] == cell and (case := graded(row)) is not None]
        if cell.startswith("linear"):
            found.append(_rate(cell, "a wrong cause with p of 0.5 or more", read, has_wrong_cause))
            continue

        if cell in (RETURNS, STAYS):
            found.append(_rate(cell, "a law with p of 0.5 or more", read, _has_law))
        if cell == STAYS:
            found.append(_rate(cell, "drift first, or a twin of the law", read, _names_drift))
        found.append(_rate(cell, "effect and joint first", read, _is_first))
        found += _parameter_errors(cell, [case.row for case in read if _is_first(case)])
        closed = [case.row["verdict"]["gap"]["closed"] for case in read if _is_first(case)]
        known = [value for value in closed if value is not None]
        if known:
            figure = {"figure": f"{cell}: part of the gap closed, median"}
            found.append(figure | {"value": float(np.median(known)), "n": len(known)})
        found += _closed_levels(cell, [case.row for case in read if _is_first(case)])
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    if seconds:
        for name, value in (("median", np.median(seconds)), ("largest", max(seconds))):
            figure = {"figure": f"core seconds, {name}", "value": float(value)}
            found.append(figure | {"n": len(seconds)})
    return found


def _is_first(case: Graded) -> bool:
    """Return whether the true effect and joint come first."""
    return right_first(case.truth, case.verdict)


def _has_law(case: Graded) -> bool:
    """Return whether a verdict names a law."""
    return any(row.effect in EFFECTS and row.probability >= 0.5 for row in case.verdict.causes)


def _names_drift(case: Graded) -> bool:
    """Return whether a verdict states drift as the first cause or as its twin."""
    causes = case.row["verdict"]["causes"]
    site = f"{causes[0]['effect']}@{causes[0]['location']}" if causes else ""
    pairs = [pair for pair in case.row["verdict"]["twins"] if site in pair]
    return any(name.startswith("drift@") for name in (site, *(n for pair in pairs for n in pair)))


def _rate(
    cell: str, words: str, read: Sequence[Graded], mark: Callable[[Graded], bool]
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


def _closed_levels(cell: str, rows: Sequence[dict]) -> list[dict[str, object]]:
    """Return the median part of the gap that is closed at each level, and where foretold."""
    parts: dict[str, list[float]] = {}
    for row in rows:
        gap = row["verdict"]["gap"]
        places = [(f"at {level['level']:g} N", level) for level in gap["levels"]]
        places += [("at the level foretold", gap["foretold"])] if gap["foretold"] else []
        for place, level in places:
            if level["closed"] is not None:
                parts.setdefault(place, []).append(level["closed"])
    return [
        {
            "figure": f"{cell}: part of the gap closed {place}, median",
            "value": float(np.median(values)),
            "n": len(values),
        }
        for place, values in parts.items()
    ]


def _case(number: int) -> dict[str, object]:
    """Diagnose the campaign of a design, which is drawn before if it is not there."""
    design = designs()[number]
    stored = ensure(design, FIRST + number)
    row = {
        "seed": stored.seed,
        "commit": describe_commit(),
        "drawn_ratio": None,
        **asdict(design),
    }
    if stored.answer is None:
        return row | {"left_out": "no place"}
    plain = stored.answer.partition("\n[dirt]")[0]
    return row | {"answer": plain, "items": dirt_items(stored.answer)} | diagnosed(stored)
