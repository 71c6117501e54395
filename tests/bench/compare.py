"""Two visits to dirty machines: is the change between them named, and is nothing named without one?

Each case is a machine that the drawing does not describe wholly, with 5 or 15 % of small
imperfections, tested twice by ``truth.draw_visits``. Between the visits one effect comes, at a
survival ratio of 3 to 8, or nothing does. The diagnosis is that of ``mbw compare``.

* *named first*: the most probable cause has effect and place of the change, and half or more of
  the probability;
* *false alarm*: a cause has half or more of the probability although nothing changed;
* *wrong cause*: likewise, of any case, a cause that is not the change.

Small imperfections are there at both visits: naming one of them is wrong. Seeds 840000 and up, on
which nothing was tuned. Rows that are done are kept, and any first part is balanced. In the
environment: ``LIMIT=30`` for the first cases, ``JOBS=1`` for the number of processes.
"""

import os
import tempfile
import time
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose
from tests.bench.beside_background import LIKELY, truth_is_first, wrong_causes
from tests.bench.kept import cases, of
from tests.bench.scorecard import core_seconds, describe_engine
from tests.bench.scorecard_draws import SIZED, TREE, Design, plan_campaign
from truth import TruthError, VirtualCampaign, draw_visits, write_campaign
from truth.grade.answer import Truth, answer_from
from truth.grade.rates import rate_of
from truth.grade.read_verdict import verdict_from
from truth.grade.verdict import NOTHING_SAID, StatedVerdict
from tuning import open_session
from tuning.files.states_campaign import write_states_campaign

CASES, FIRST = 90, 840_000  # two of three have a change
NAME = f"compare.{FIRST}"
RATIOS = (3.0, 8.0)
DIRTS = (5.0, 15.0)  # per cent of the motion
# What can come between two visits: a test that drifts, and what is mounted or aimed anew, cannot.
NO_CHANGES = ("drift", "hammer_misalignment", "sensor_misalignment", "sensor_position")
CHANGES = tuple(name for name in SIZED if name not in NO_CHANGES)
_TRIES, _NEXT_SEED = 5, 1_000  # seeds, until a machine has a place for the change
Graded = tuple[dict, Truth, StatedVerdict]
Visits = tuple[VirtualCampaign, VirtualCampaign]


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the rates."""
    count = min(int(os.environ.get("LIMIT", CASES)), CASES)
    cases(NAME, range(count), _case, int(os.environ.get("JOBS", "1")))
    return rate_rows(list(of(NAME).values()))


def list_designs() -> tuple[Design, ...]:
    """Return what each machine has: every third nothing new, every fourth a random tree."""
    random = np.random.default_rng(FIRST)
    names = cycle(np.array(CHANGES)[random.permutation(len(CHANGES))].tolist())
    dirts = cycle(DIRTS)
    # Well within the limits: a draw comes near its ratio, and those beyond the limits are dropped.
    ratios = np.exp(random.uniform(*np.log((3.5, 7.0)), CASES)).tolist()
    return tuple(
        Design(
            cell="nothing" if number % 3 == 0 else "change",
            effects=() if number % 3 == 0 else (next(names),),
            ratio=ratios[number],
            dirt=next(dirts),
            machine=TREE if number % 4 == 3 else "station",
        )
        for number in range(CASES)
    )


def _case(number: int) -> dict[str, object]:
    """Draw and diagnose one machine; a row says what was drawn and found."""
    design = list_designs()[number]
    row: dict[str, object] = {
        "engine": describe_engine(),
        "cell": design.cell,
        "dirt": design.dirt,
        "machine": design.machine,
    }
    with threadpool_limits(1), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drawn = _draw(design, FIRST + number)
        if drawn is None:
            return row | {"left_out": "no machine has a change of this ratio"}
        visits, seed, effects = drawn
        row |= {"seed": seed, "effects": list(effects)}
        row["answer"] = visits[1].answer.decode().partition("\n[dirt]")[0]
        for state, visit in zip(("before", "after"), visits, strict=True):
            write_campaign(visit, folder / state, sealed=True)
        both = folder / "both"
        both.mkdir()
        write_states_campaign(folder / "before", folder / "after", both, both)
        began, spent = time.perf_counter(), core_seconds()
        try:
            verdict = build_verdict(diagnose(open_session(both)))
            row["verdict"] = verdict.model_dump(mode="json")
        except Exception as error:  # graded as a failure, the other cases go on
            row["error"] = f"{type(error).__name__}: {error}"
        seconds = {"seconds": core_seconds() - spent, "wall": time.perf_counter() - began}
    return row | seconds


def _draw(design: Design, seed: int) -> tuple[Visits, int, tuple[str, ...]] | None:
    """Return both visits, the seed and the change; None if no try has a change of the ratio.

    Beside much dirt few effects reach the ratio anywhere: each try takes the next effect.
    """
    for turn in range(_TRIES):
        effects = tuple(
            CHANGES[(CHANGES.index(name) + turn) % len(CHANGES)] for name in design.effects
        )
        used = seed + turn * _NEXT_SEED
        try:
            visits = draw_visits(*plan_campaign(replace(design, effects=effects), used))
        except TruthError:
            continue
        if not effects or has_ratio(visits[1].answer.decode()):
            return visits, used, effects
    return None


def has_ratio(answer: str) -> bool:
    """Return whether the survival ratio of an answer is one that counts."""
    ratio = tomllib.loads(answer).get("ratio")
    return ratio is not None and RATIOS[0] <= ratio <= RATIOS[1]


def grade(row: dict) -> Graded | None:
    """Return a row with its change and its verdict; None if it was left out."""
    if "left_out" in row:
        return None
    truth = answer_from(tomllib.loads(row["answer"]), "answer")
    try:
        return row, truth, verdict_from(row.get("verdict"))
    except TruthError:
        return row, truth, NOTHING_SAID


def rate_rows(rows: Sequence[dict]) -> list[dict[str, object]]:
    """Return the rates of changes, of unchanged machines, and of both."""
    graded = [case for row in rows if (case := grade(row)) is not None]
    groups = {
        "one change": [case for case in graded if case[0]["effects"]],
        "nothing changed": [case for case in graded if not case[0]["effects"]],
        "all": graded,
    }
    return [_rate(label, group) for label, group in groups.items() if group]


def _rate(label: str, group: Sequence[Graded]) -> dict[str, object]:
    """Return rates in per cent with Wilson's intervals."""
    changes = [case for case in group if case[0]["effects"]]
    rates = {
        "named first": rate_of(float(is_named_first(*case[1:])) for case in changes),
        "wrong cause": rate_of(float(bool(wrong_causes(*case[1:]))) for case in group),
    }
    figures: dict[str, object] = {"cases": label, "n": len(group)}
    for name, rate in rates.items():
        for part, value in (("", rate.rate), (" from", rate.low), (" to", rate.high)):
            figures[f"{name}{part}"] = None if value is None else 100 * value
    failed = sum(case[2] is NOTHING_SAID for case in group)
    return figures | {
        "errors": failed,
        "core s": float(np.median([case[0]["seconds"] for case in group])),
    }


def is_named_first(truth: Truth, verdict: StatedVerdict) -> bool:
    """Return whether the most probable cause is the change, with half the probability or more."""
    is_first = truth_is_first(truth, verdict)
    return is_first and verdict.causes[0].probability >= LIKELY
