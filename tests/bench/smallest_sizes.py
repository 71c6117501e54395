"""Are predicted smallest sizes found, those twice as large, and not those half as large?

The servo axis is tested as ``mbw blind MODEL --smallest`` predicts it. At the places where a usual
size is only just found, one of each effect, machines with half, once and twice the predicted size
are drawn and diagnosed. Nine of ten of the predicted size should be found. Sizes and places take
turns, so that any first part is balanced. Seeds 452000 and up shaped nothing; the prediction was
developed on 880000 and up.

Rows that are done are kept. In the environment: ``LIMIT=60`` for the first sixty, ``JOBS=1`` for
the number of processes.
"""

import os
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from diagnosis.next_test.smallest_sizes import SmallestSize
from mbw.blind.case import BlindCase, run_case
from mbw.blind.grading import graded_case
from mbw.blind.request import build_request, prepare_folder
from mbw.blind.smallest import choose_places, predict
from mbw.blind.user_test import read_test
from tests.bench.kept import cases, of
from tests.helpers.any_machines import SERVO_AXIS
from truth import Choice
from truth.campaign.case_design import deal_cards
from truth.grade import grade
from truth.grade.rates import wilson

SEED = 452_000
NAME = f"smallest_sizes.{SEED}"
PLACES, DRAWS = 8, 12
SIZES = (1.0, 2.0, 0.5)  # over the predicted size


def run() -> list[dict[str, object]]:
    """Draw and diagnose what is missing; return the rates of each place."""
    limit = int(os.environ.get("LIMIT", PLACES * DRAWS * len(SIZES)))
    cases(
        NAME,
        range(min(limit, PLACES * DRAWS * len(SIZES))),
        _case,
        int(os.environ.get("JOBS", "1")),
    )
    rows = list(of(NAME).values())
    places = dict.fromkeys((row["effect"], row["location"]) for row in rows)
    return [_rate(place, rows) for place in places]


def _scale(place: SmallestSize, factor: float) -> float:
    """Return the parameter of an effect of a multiple of the predicted size."""
    value = place.value or 0.0
    if place.parameter in ("gain", "factor"):
        return 1 + factor * (value - 1)
    if place.parameter == "frequency":  # of a mount: the size is its inverse square
        return value / factor**0.5
    return value / factor if place.parameter == "stiffness" else value * factor


@cache
def _places() -> tuple[SmallestSize, ...]:
    """Return the places with their predicted sizes."""
    with tempfile.TemporaryDirectory() as folder:
        return tuple(choose_places(predict(read_test(_model(folder), None), Choice()), PLACES))


def _model(folder: str) -> Path:
    path = Path(folder) / "servo_axis.xml"
    path.write_text(SERVO_AXIS, encoding="utf-8")
    return path


def _case(number: int) -> dict[str, object]:
    """Return whether one draw of a multiple of a predicted size is found."""
    turn, which = divmod(number, len(_places()))
    place, factor = _places()[which], SIZES[turn % len(SIZES)]
    value = _scale(place, factor)
    choice = Choice((place.effect,), (place.location,), (), (place.parameter, value))
    seed = SEED + number
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "blind"
        out.mkdir()
        model = str(_model(folder))
        first = next(k for k, card in enumerate(deal_cards(seed, choice)) if card.names)
        case = BlindCase(model, seed, first, out, None, choice, further="")
        prepare_folder(build_request(model, seed, None, choice=choice), out, overwrite=False)
        outcome = run_case(case)
        row: dict[str, object] = {
            "seed": seed,
            "effect": place.effect,
            "location": place.location,
            "parameter": place.parameter,
            "value": place.value,
            "times": factor,
        }
        if outcome.error:
            return {**row, "failed": outcome.error}
        (line,) = grade([graded_case(case)], baselines=False).lines
    return {**row, "found": line.marks["both_or_twin"], "first": line.first}


def _rate(place: tuple[str, str], rows: Sequence[dict]) -> dict[str, object]:
    """Return how often multiples of the predicted size of one place are found (Wilson)."""
    of_place = [row for row in rows if (row["effect"], row["location"]) == place]
    keys = ("effect", "location", "parameter", "value")
    rates: dict[str, object] = {key: of_place[0][key] for key in keys}
    for factor in SIZES:
        cases = [row for row in of_place if row["times"] == factor and "found" in row]
        hits = round(sum(row["found"] for row in cases))
        low, high = wilson(hits, len(cases)) if cases else (0.0, 1.0)
        rates |= {f"{factor:g}": {"n": len(cases), "found": hits, "from": low, "to": high}}
    return rates
