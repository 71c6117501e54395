"""Readers of the committed results of the benches: JSON rows."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "tests" / "bench" / "results"


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
