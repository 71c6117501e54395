"""Are predicted smallest sizes found? Fresh draws at three places, nine of ten of which should be.

The servo axis is tested as ``mbw blind MODEL --smallest`` predicts it. At the three places where a
usual size is only just found, machines with exactly the predicted size are drawn and diagnosed.
The places take turns, so that any first part is balanced. Seeds 450000 and up shaped nothing; the
prediction was developed on 449000 and 990000 and up.

Rows that are done are kept. In the environment: ``LIMIT=60`` for the first sixty, ``JOBS=1`` for
the number of processes.
"""

import os
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from diagnosis.next_test.smallest_sizes import SmallestSize
from mbw.blind.case import run_case
from mbw.blind.case_files import BlindCase
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

SEED = 450_000
NAME = f"smallest_sizes.{SEED}"
PLACES, DRAWS = 3, 40


def run() -> list[dict[str, object]]:
    """Draw and diagnose what is missing; return the rate of each place."""
    limit = int(os.environ.get("LIMIT", PLACES * DRAWS))
    cases(NAME, range(min(limit, PLACES * DRAWS)), _case, int(os.environ.get("JOBS", "1")))
    rows = list(of(NAME).values())
    places = dict.fromkeys((row["effect"], row["location"]) for row in rows)
    return [_rate(place, rows) for place in places]


@cache
def _places() -> tuple[SmallestSize, ...]:
    """Return the three places with their predicted sizes."""
    with tempfile.TemporaryDirectory() as folder:
        return tuple(choose_places(predict(read_test(_model(folder), None), Choice()), PLACES))


def _model(folder: str) -> Path:
    path = Path(folder) / "servo_axis.xml"
    path.write_text(SERVO_AXIS, encoding="utf-8")
    return path


def _case(number: int) -> dict[str, object]:
    """Return whether one draw of the predicted size is found."""
    place = _places()[number % PLACES]
    choice = Choice((place.effect,), (place.location,), (), (place.parameter, place.value or 0.0))
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
            "of usual": place.of_usual,
        }
        if outcome.error:
            return {**row, "failed": outcome.error}
        (line,) = grade([graded_case(case)], baselines=False).lines
    return {**row, "found": line.marks["both_or_twin"], "first": line.first}


def _rate(place: tuple[str, str], rows: Sequence[dict]) -> dict[str, object]:
    """Return how often the predicted size of one place is found, with its Wilson interval."""
    place_rows = [
        row for row in rows if (row["effect"], row["location"]) == place and "found" in row
    ]
    hits = round(sum(row["found"] for row in place_rows))
    low, high = wilson(hits, len(place_rows))
    first = place_rows[0]
    return {
        **{key: first[key] for key in ("effect", "location", "parameter", "value", "of usual")},
        "n": len(place_rows),
        "found": hits,
        "from": low,
        "to": high,
    }
