"""Each rung of the search turned off in turn, on calibration campaigns.

The campaigns are the first designs of ``scorecard_draws`` with seeds 420000 and up, which no
reported figure uses; faults that dirt hides are left out. ``LIMIT`` in the environment says how
many designs there are; rows that are done are kept. The difference of a rate is that of the same
campaigns, with Newcombe's interval for paired proportions. A rung whose absence moves neither the
rate beyond its interval nor the time can go. ``RUNGS=all,"no materiality"`` chooses rungs. Settings
without a rung have their reason in ``KEPT``; rules of the posterior need no new fits
(``posterior_rules``).
"""

import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, replace
from functools import partial
from unittest.mock import patch

from diagnosis.settings import SETTINGS, DiagnosisSettings
from tests.bench.kept import cases, of
from tests.bench.scorecard import diagnosed
from tests.bench.scorecard_draws import ensure, reported_designs
from tests.bench.scorecard_rates import read_rows
from truth.grade.rates import paired_difference, wilson
from tuning import FloorSchedule

FIRST = 420_000
DEFAULT_LIMIT = 12
RUNGS: dict[str, DiagnosisSettings] = {
    "all": SETTINGS,
    "one refit a round": replace(SETTINGS, max_refits=1),
    "no variants and replacements": replace(SETTINGS, max_variants=0),
    "floors in one turn": replace(SETTINGS, schedule=FloorSchedule(max_turns=1)),
    "no bodies that bend": replace(SETTINGS, max_bending_bodies=0),
    "one start of a body's mode": replace(SETTINGS, bending_start_ratios=(1.0,)),
    "no moved causes": SETTINGS,
}
STEPS: dict[str, tuple[str, Callable[..., object]]] = {  # steps without a setting, left out
    "no moved causes": (
        "diagnosis.search.selection.move_causes",
        lambda scene, search, best, causes, settings: (search, best),
    ),
}
KEPT = {
    **dict.fromkeys(
        (
            "min_probability",
            "min_row_probability",
            "min_twin_cosine",
            "min_place_cosine",
            "twin_nats",
        ),
        "contract of the verdict",
    ),
    **dict.fromkeys(
        ("score_stride", "max_force_values"),
        "cost of a fit: lines and memory, not a rate",
    ),
    **dict.fromkeys(
        ("appendage_ends", "max_added_mass_share", "delay_phases_rad"),
        "range of an effect: without it the effect has no end",
    ),
    "interval_points": "numerical error of what is stated, not a rate",
    **dict.fromkeys(
        ("max_causes", "min_closed", "outlier_sigma"), "rules of the posterior have a table"
    ),
    **dict.fromkeys(
        ("force_floor_ratio", "force_powers"), "they move places where no cause is found, no cause"
    ),
    "serial_lags": "statistics of the noise: a variance spans three lines",
    "min_proven_probability": "odds of nine to one before a fault counts as proven",
    "min_local_share": "a word about the rest, not a rate",
    "added_mass_share": "what the next experiment proposes",
    "slope_tolerance": "effects of other packages",
    **dict.fromkeys(
        (
            "predicted_share",
            "predicted_shapes",
            "predicted_directions",
            "predicted_size_steps",
        ),
        "predictions of a test, no verdict",
    ),
}


def run() -> list[dict[str, object]]:
    """Diagnose what is missing; return the rate of right verdicts and the time of each rung."""
    limit = int(os.environ.get("LIMIT", DEFAULT_LIMIT))
    chosen = os.environ.get("RUNGS", ",".join(RUNGS)).split(",")
    for number in range(limit):
        for rung in chosen:
            cases(rows_name(rung), [number], partial(_case, rung))
    figures: list[dict[str, object]] = []
    for rung in RUNGS:
        figures += rung_figures(rung, of(rows_name(rung)), of(rows_name("all")))
    return figures


def rows_name(rung: str) -> str:
    """Return the name of the file of a rung's rows."""
    return f"ablation.{rung.replace(' ', '_').replace(chr(39), '')}"


def rung_figures(
    rung: str, rows: dict[int, dict], complete: dict[int, dict]
) -> list[dict[str, object]]:
    """Return rate and mean time of a rung's rows, and how it differs from all rungs.

    Args:
        rung: its name.
        rows: its rows, by number.
        complete: rows with all rungs.
    """
    read = {number: case for number, row in rows.items() for case in read_rows([row])}
    if not read:
        return []
    hits, count = sum(case.is_right for case in read.values()), len(read)
    low, high = wilson(hits, count)
    seconds = sum(case.row["seconds"] for case in read.values()) / count
    interval = f"{count} [{100 * low:.1f}, {100 * high:.1f}]"
    figures: list[dict[str, object]] = [
        {"figure": f"{rung}: right, %", "value": 100 * hits / count, "n": interval},
        {"figure": f"{rung}: core seconds, mean", "value": seconds, "n": count},
    ]
    pairs = [
        (read[number].is_right, case.is_right)
        for number in read
        if number in complete
        for case in read_rows([complete[number]])
    ]
    if rung == "all" or not pairs:
        return figures
    paired = paired_difference(pairs)
    interval = f"{paired.n} [{100 * paired.low:.1f}, {100 * paired.high:.1f}]"
    difference = {
        "figure": f"{rung}: difference, %",
        "value": 100 * paired.difference,
        "n": interval,
    }
    return [*figures, difference]


def _case(rung: str, number: int) -> dict[str, object]:
    """Diagnose one campaign with one rung turned off."""
    design = reported_designs()[number]
    stored = ensure(design, FIRST + number)
    with ExitStack() as changes:
        if rung in STEPS:
            changes.enter_context(patch(*STEPS[rung]))
        return {"seed": stored.seed, **asdict(design), **diagnosed(stored, RUNGS[rung])}
