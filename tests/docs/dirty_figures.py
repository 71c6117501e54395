"""Figures of the bench of real machines; they say so while no campaign was diagnosed."""

from collections import Counter

from tests.bench.dirty import EARLIER, FIRST
from tests.bench.dirty_rates import figures, wrong_rows
from tests.bench.kept import of
from tests.docs.formats import significant, table
from tests.docs.results import RESULTS, bench_rows

NAME = f"dirty.{FIRST}"
NOT_YET = "No campaign was diagnosed yet"


def dirty_table() -> str:
    """Rates of every cell with their intervals, calibration, time, and two engines compared."""
    rows = bench_rows("dirty") if (RESULTS / "dirty.json").is_file() else ()
    cells = [(row["figure"], significant(row["value"], 3), row["n"]) for row in rows]
    return table(("Figure", "Value", "n [95 % interval]"), cells or [(NOT_YET, "", 0)])


def dirty_earlier_table() -> str:
    """Rates of the engines before, on campaigns of which some shaped the one of today."""
    earlier = [row for first in EARLIER for row in of(f"dirty.{first}").values()]
    rows = figures(earlier, [])
    cells = [(row["figure"], significant(row["value"], 3), row["n"]) for row in rows]
    return table(("Figure", "Value", "n [95 % interval]"), cells)


def dirty_wrong_table() -> str:
    """Seed, truth and words of every wrong verdict."""
    wrong = wrong_rows(list(of(NAME).values())) if (RESULTS / "dirty.json").is_file() else []
    return table(
        ("Seed", "Cell and truth", "Verdict and its first causes"), wrong or [("", "none", "")], 3
    )


def dirty_campaigns() -> str:
    """Number of campaigns that were diagnosed."""
    return str(sum("left_out" not in row for row in of(NAME).values()))


def count_engines(name: str) -> str:
    """Return numbers of diagnosed campaigns by the commit of the engine, the most first.

    Args:
        name: of the rows.
    """
    rows = [row for row in of(name).values() if "left_out" not in row]
    counts = Counter(row.get("commit", "") for row in rows)
    return ", ".join(
        f"{count} by {f'commit {commit}' if commit else 'engines before it'}"
        for commit, count in sorted(counts.items(), key=lambda pair: (not pair[0], -pair[1]))
    )


def dirty_engines() -> str:
    """Numbers of campaigns by the commit of the engine."""
    return count_engines(NAME)


def dirty_first_seed() -> str:
    """First seed of the table."""
    return str(FIRST)


def dirty_earlier_seeds() -> str:
    """First seeds of earlier tables."""
    *first, last = map(str, EARLIER)
    return f"{', '.join(first)} and {last}"


FIGURES = {
    "dirty-first-seed": dirty_first_seed,
    "dirty-earlier-seeds": dirty_earlier_seeds,
    "dirty-table": dirty_table,
    "dirty-earlier-table": dirty_earlier_table,
    "dirty-wrong-table": dirty_wrong_table,
    "dirty-campaigns": dirty_campaigns,
    "dirty-engines": dirty_engines,
}
