"""Can causes be told without FRFs? 1000 campaigns, drawn in full, and a leak that is planted.

Seed 61000. Features are kept in ``results/leaks.cases.jsonl`` until all are there: an interrupted
bench goes on from where it was.
"""

from threadpoolctl import threadpool_limits

from tests.bench.kept import cases
from tests.helpers.leaks import features, seen
from truth import draw_case
from truth.machine.random_tree import draw_tree

CASES, JOBS, SEED = 1000, 1, 61_000


def run() -> list[dict[str, object]]:
    """Balanced accuracy of boosted trees; chance is one over the number of classes."""
    rows, kept = cases("leaks", range(CASES), _drawn)
    found = [
        _row("whether something is missing", "missing", rows),
        _row("kind of place", "place", rows),
    ]
    for fifths in (2, 5):
        planted = [_planted(row, fifths) for row in rows]
        name = f"planted: one hit more in {fifths} of 5 where nothing is missing"
        found.append(_row(name, "missing", planted))
    kept.unlink()
    return found


def _planted(row: dict, fifths: int) -> dict:
    more = row["missing"] == "nothing" and row["number"] % 5 < fifths
    averages = row["features"]["test 0 averages"] + more
    return row | {"features": row["features"] | {"test 0 averages": averages}}


def _drawn(number: int) -> dict[str, object]:
    with threadpool_limits(1):
        case = draw_case(draw_tree(2, 3), SEED, number)
    answer = case.campaign.answer.decode()
    place = answer.partition('location = "')[2].partition(":")[0]
    return {
        "number": number,
        "features": features(case.campaign.files),
        "missing": "something" if case.plan.cause.wanted else "nothing",
        "place": place or "nowhere",
        "machine": case.plan.seed,
    }


def _row(name: str, key: str, rows: list[dict]) -> dict[str, object]:
    found = seen(
        [row["features"] for row in rows],
        [row[key] for row in rows],
        [row["machine"] for row in rows],
    )
    return {
        "told": name,
        "n": found.n,
        "balanced accuracy %": 100 * found.accuracy,
        "from": 100 * found.low,
        "to": 100 * found.high,
        "chance %": 100 * found.chance,
    }
