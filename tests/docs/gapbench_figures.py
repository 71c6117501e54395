"""Figures of GapBench: the baselines and the diagnosis of this repository on the bundled set."""

from collections import Counter
from functools import cache

from gapbench.__main__ import BUNDLED
from gapbench.run import open_set
from gapbench.table import Row, differences_table, entries_table, grade_file, strata_table
from tests.docs.results import RESULTS

ENTRIES = {
    "mbw diagnose": "ours",
    "latent force": "latent_force",
    "ranking": "ranking",
    "refit only": "refit_only",
}


@cache
def gapbench_runs() -> dict[str, list[Row]]:
    """Return the marks of each entry on the cases that the first one has reached."""
    with open_set(BUNDLED) as (_, keys):
        runs = {
            name: grade_file(RESULTS / "gapbench" / f"{file}.jsonl", keys)
            for name, file in ENTRIES.items()
        }
    reached = {row["case"] for row in next(iter(runs.values()))}
    return {name: [row for row in rows if row["case"] in reached] for name, rows in runs.items()}


def gapbench_whole() -> str:
    """Return the marks of the baselines on the whole set."""
    with open_set(BUNDLED) as (_, keys):
        return entries_table(
            {
                name: grade_file(RESULTS / "gapbench" / f"{file}.jsonl", keys)
                for name, file in list(ENTRIES.items())[1:]
            }
        )


def gapbench_wins() -> str:
    """Return how often a baseline is right where the diagnosis is not, by stratum."""
    (_, first), *baselines = gapbench_runs().items()
    missed = {row["case"] for row in first if not row["right"]}
    texts = []
    for name, rows in baselines:
        won = Counter(row["stratum"] for row in rows if row["right"] and row["case"] in missed)
        if won:
            texts.append(f"{name} in {', '.join(f'{n} of {s}' for s, n in won.items())}")
    return "; ".join(texts) or "no baseline in any case"


FIGURES = {
    "gapbench-wins": gapbench_wins,
    "gapbench-cases": lambda: str(len(gapbench_runs()["mbw diagnose"])),
    "gapbench-table": lambda: entries_table(gapbench_runs()),
    "gapbench-strata-table": lambda: strata_table(gapbench_runs()),
    "gapbench-differences-table": lambda: differences_table(gapbench_runs()),
    "gapbench-baselines-table": gapbench_whole,
}
