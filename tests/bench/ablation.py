"""Each rung and threshold of the diagnosis turned off in turn, on calibration campaigns.

The campaigns are the first designs of ``dirty_campaigns`` with seeds 420000 and up, which no
reported figure uses. ``LIMIT`` in the environment says how many are diagnosed with each rung;
rows that are done are kept. A rung whose absence moves no rate beyond its interval can go.
"""

import os
from dataclasses import replace
from functools import partial

from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose
from diagnosis.settings import SETTINGS, DiagnosisSettings
from tests.bench.dirty import core_seconds, dirt_items
from tests.bench.dirty_campaigns import ensure, reported_designs
from tests.bench.dirty_rates import graded, is_right_row
from tests.bench.kept import cases, of
from truth.grade.rates import wilson
from tuning import open_session

FIRST = 420_000
DEFAULT_LIMIT = 12
RUNGS: dict[str, DiagnosisSettings] = {
    "all": SETTINGS,
    "one refit a round": replace(SETTINGS, max_refits=1),
    "no distant starts": replace(SETTINGS, max_distant=0),
    "no other shapes": replace(SETTINGS, max_other_shapes=0),
    "no improbable first cause": replace(SETTINGS, max_improbable=0),
    "no bodies that bend": replace(SETTINGS, max_bending_bodies=0),
    "one start of a body's mode": replace(SETTINGS, bending_start_ratios=(1.0,)),
    "no materiality": replace(SETTINGS, min_closed=0.0),
    "outliers are causes": replace(SETTINGS, outlier_sigma=0.0),
    "free forces at the whole floor": replace(SETTINGS, force_floor_ratio=1.0),
    "null model in four turns": replace(SETTINGS, null_schedule=SETTINGS.schedule),
}


def run() -> list[dict[str, object]]:
    """Diagnose what is missing; return the rate of right verdicts and the time of each rung."""
    limit = int(os.environ.get("LIMIT", DEFAULT_LIMIT))
    figures: list[dict[str, object]] = []
    for rung in RUNGS:
        cases(rows_name(rung), range(limit), partial(_case, rung))
        figures += rung_figures(rung, list(of(rows_name(rung)).values()))
    return figures


def rows_name(rung: str) -> str:
    """Return the name of the file of a rung's rows."""
    return f"ablation.{rung.replace(' ', '_').replace(chr(39), '')}"


def rung_figures(rung: str, rows: list[dict]) -> list[dict[str, object]]:
    """Return rate and mean time of a rung's rows."""
    read = [case for row in rows if (case := graded(row)) is not None]
    if not read:
        return []
    hits, count = sum(map(is_right_row, read)), len(read)
    low, high = wilson(hits, count)
    seconds = sum(case.row["seconds"] for case in read) / count
    interval = f"{count} [{100 * low:.1f}, {100 * high:.1f}]"
    return [
        {"figure": f"{rung}: right, %", "value": 100 * hits / count, "n": interval},
        {"figure": f"{rung}: core seconds, mean", "value": seconds, "n": count},
    ]


def _case(rung: str, number: int) -> dict[str, object]:
    """Diagnose one campaign with one rung turned off."""
    design = reported_designs()[number]
    stored = ensure(design, FIRST + number)
    if stored.answer is None:
        return {"left_out": "no place"}
    began = core_seconds()
    with threadpool_limits(1):
        diagnosis = diagnose(open_session(stored.folder), settings=RUNGS[rung])
    return {
        "seed": stored.seed,
        "cell": design.cell,
        "dirt": design.dirt,
        "effects": list(design.effects),
        "parameter": design.parameter,
        "drawn_ratio": None,
        "answer": stored.answer.partition("\n[dirt]")[0],
        "items": dirt_items(stored.answer),
        "verdict": build_verdict(diagnosis).model_dump(mode="json"),
        "seconds": core_seconds() - began,
    }
