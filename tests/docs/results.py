"""Readers of the committed results of the benches: JSON rows, kept cases and grade tables."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.bench.kept import of

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "tests" / "bench" / "results"
RATE = re.compile(r"([\d.]+) %(?: \[([\d.]+), ([\d.]+)\])? n=(\d+)")


@dataclass(frozen=True)
class Rate:
    """A share of cases in percent.

    Attributes:
        percent: the share.
        interval: 95 % interval by Wilson, in percent; None where the file gives none.
        n: number of cases.
    """

    percent: float
    interval: tuple[float, float] | None
    n: int

    def __str__(self) -> str:
        if self.interval is None:
            return f"{self.percent:.1f} %"
        low, high = self.interval
        return f"{self.percent:.1f} % [{low:.1f}, {high:.1f}]"


@cache
def bench_rows(bench: str) -> Sequence[Mapping]:
    """Return the rows of ``results/<bench>.json``."""
    return json.loads((RESULTS / f"{bench}.json").read_text(encoding="utf-8"))


@cache
def bench_values(bench: str) -> Mapping[str, Mapping]:
    """Return the rows of a bench that names each of its figures, by that name."""
    return {row["figure"]: row for row in bench_rows(bench)}


@cache
def bench_cases(name: str) -> Sequence[Mapping]:
    """Return the cases of ``results/<name>.cases.jsonl`` that were diagnosed, in order."""
    cases = of(name)
    return [cases[number] for number in sorted(cases) if cases[number].get("verdict") is not None]


def seeds_of(name: str) -> tuple[int, int]:
    """Return the first and the last seed of ``results/<name>.cases.jsonl``."""
    seeds = [row["seed"] for row in of(name).values()]
    return min(seeds), max(seeds)


@cache
def grade_tables(bench: str) -> Mapping[str, Mapping[str, Mapping[str, str]]]:
    """Return the tables of ``results/<bench>.txt``: title, then label of the row, then column.

    A block without a title is named by the first cell of its header. Where several rows have one
    label, as in the table of sizes, the first one stays.
    """
    text = (RESULTS / f"{bench}.txt").read_text(encoding="utf-8")
    tables: dict[str, dict[str, dict[str, str]]] = {}
    for block in text.split("\n\n")[1:]:
        lines = block.rstrip().splitlines()
        title = "" if len(_cells(lines[0])) > 1 else lines.pop(0)
        header = _cells(lines[0])
        rows: dict[str, dict[str, str]] = {}
        for cells in map(_cells, lines[1:]):
            if len(cells) == len(header):
                rows.setdefault(cells[0], dict(zip(header, cells, strict=True)))
        tables[title or header[0]] = rows
    return tables


def grade_rate(bench: str, title: str, label: str, column: str) -> Rate:
    """Return one rate of a grade table; `LookupError` where the table has none."""
    match = RATE.fullmatch(grade_tables(bench)[title][label][column])
    if match is None:
        raise LookupError(f"{bench}.txt, {title}, {label}: no rate in column {column}")
    percent, low, high, n = match.groups()
    interval = None if low is None else (float(low), float(high))
    return Rate(float(percent), interval, int(n))


def _cells(line: str) -> list[str]:
    """Return the cells of an aligned line; an empty first cell where it begins with spaces."""
    return re.split(r"\s{2,}", line.rstrip())
