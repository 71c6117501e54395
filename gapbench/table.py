"""Marks of a run, and the table of several runs with intervals of rates and of differences."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any, TypeAlias

from gapbench.answer import NO_ANSWER, AnswerError, read_answer
from gapbench.grader import grade
from gapbench.rates import paired_difference, rate_of
from gapbench.run import RunError, read_rows

Row: TypeAlias = Mapping[str, Any]  # of a case: name, stratum, marks and cost
_HEADER = (
    "Entry",
    "n",
    "Right",
    "Effect",
    "Place",
    "Set",
    "Wrong cause",
    "False alarm",
    "Size within 10 %",
    "Interval holds",
    "Shrink",
    "Log",
    "Brier",
    "Core seconds",
)


def grade_file(path: Path, keys: Mapping[str, Any]) -> list[Row]:
    """Return the marks of every case that a run has reached; no answer is graded as such.

    Args:
        path: file of answers.
        keys: of the set.

    Raises:
        RunError: the answers are of another set, or there are none.
    """
    effects, graded = frozenset(keys["effects"]), list[Row]()
    head, rows = read_rows(path)
    if head["seed"] != keys["seed"] or not rows.keys() <= keys["cases"].keys():
        raise RunError(
            f"{path}: holds answers to the set of seed {head['seed']}, not of {keys['seed']}: name "
            "its set by --set"
        )
    if not rows:
        raise RunError(f"{path}: holds no answers yet: run the entry first")
    for name, row in sorted(rows.items()):
        answer = NO_ANSWER
        if "answer" in row:
            try:
                answer = read_answer(json.dumps(row["answer"]), effects)
            except AnswerError as error:
                raise RunError(f"{path}, {name}: {error}") from error
        key = keys["cases"][name]
        cost = {"core_seconds": row["core_seconds"], "error": row.get("error")}
        graded.append({"case": name, "stratum": key["stratum"], **grade(answer, key), **cost})
    return graded


def summary(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return n, rates with their 95 % intervals, means, and the median of core seconds."""

    def rate(name: str) -> str:
        shares = rate_of(row[name] for row in rows)
        if shares.rate is None:
            return ""
        inside = ""
        if shares.low is not None and shares.high is not None:
            inside = f" [{100 * shares.low:.0f}, {100 * shares.high:.0f}]"
        return f"{100 * shares.rate:.0f} %{inside}"

    def mean(name: str) -> str:
        numbers = [row[name] for row in rows if row[name] is not None]
        return f"{fmean(numbers):.2f}" if numbers else ""

    return (
        str(len(rows)),
        rate("right"),
        *map(mean, ("effect", "place", "set")),
        rate("wrong"),
        rate("false_alarm"),
        *map(mean, ("size", "inside", "shrink", "log", "brier")),
        f"{median(row['core_seconds'] for row in rows):.0f}",
    )


def difference(first: Sequence[Row], second: Sequence[Row]) -> str:
    """Return the difference of the rates of right answers, of the cases that both runs have."""
    right = [{row["case"]: bool(row["right"]) for row in rows} for rows in (first, second)]
    both = sorted(right[0].keys() & right[1].keys())
    paired = paired_difference((right[0][case], right[1][case]) for case in both)
    low, high = 100 * paired.low, 100 * paired.high
    return f"{100 * paired.difference:+.0f} % [{low:+.0f}, {high:+.0f}], n {paired.n}"


def markdown(runs: Mapping[str, Sequence[Row]]) -> str:
    """Return all tables, one below the other."""
    tables = (entries_table(runs), strata_table(runs), differences_table(runs))
    return "\n\n".join(text for text in tables if text)


def entries_table(runs: Mapping[str, Sequence[Row]]) -> str:
    """Return the marks of each run over all its cases."""
    return _table(_HEADER, [(name, *summary(rows)) for name, rows in runs.items()])


def strata_table(runs: Mapping[str, Sequence[Row]]) -> str:
    """Return the rates of right answers of each run by stratum, each with its n."""
    strata = list(dict.fromkeys(row["stratum"] for rows in runs.values() for row in rows))
    lines = []
    for name, rows in runs.items():
        cells = []
        for stratum in strata:
            here = [row for row in rows if row["stratum"] == stratum]
            n, right, *_ = summary(here) if here else ("0", "")
            cells.append(f"{right}, n {n}" if here else "n 0")
        lines.append((name, *cells))
    return _table(("Right in", *strata), lines)


def differences_table(runs: Mapping[str, Sequence[Row]]) -> str:
    """Return the first run's rate of right answers less that of each other one; empty of one."""
    (first, reference), *further = runs.items()
    rows = [(f"{first} less {name}", difference(reference, rows)) for name, rows in further]
    return _table(("Difference of right", "95 % interval, n"), rows) if rows else ""


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
