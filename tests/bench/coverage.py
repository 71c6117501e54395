"""Do the 95 % intervals of a tuning hold? 200 machines of ``truth/`` that lack nothing.

Seeds 66000 and up are reported only; 63000 to 63090 chose how far a pull is plausible. Machines
that are done are kept in ``results/coverage.cases.jsonl`` until all are: an interrupted bench goes
on from where it was.
"""

from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tests.bench.kept import cases
from tests.helpers.coverage import covered
from truth import Protocol, read_station

MACHINES, FIRST, JOBS = 200, 66_000, 1
ROOT = Path(__file__).resolve().parents[2]


def run() -> list[dict[str, object]]:
    """Coverage pooled, with an interval that counts machines."""
    rows, kept = cases("coverage", range(FIRST, FIRST + MACHINES), _covered, JOBS)
    found = [_row(kind, rows) for kind in ("stiffness", "damping", "FRF")]
    kept.unlink()
    return found


def _covered(seed: int) -> dict[str, object]:
    with threadpool_limits(1):
        station = read_station(ROOT / "assets" / "microstation" / "station.xml")
        return covered(station, seed, Protocol())


def _row(kind: str, rows: list[dict]) -> dict[str, object]:
    """Pooled coverage; its interval is that of the mean over machines."""
    each = np.array([row[kind][0] / row[kind][1] for row in rows])
    half = 1.96 * each.std(ddof=1) / np.sqrt(len(each))
    return {
        "of": kind,
        "machines": len(rows),
        "n": sum(row[kind][1] for row in rows),
        "coverage %": 100 * float(each.mean()),
        "from": 100 * float(each.mean() - half),
        "to": 100 * float(each.mean() + half),
        "largest pull": max(abs(row["largest pull"]) for row in rows),
        "chi square": float(np.mean([row["chi square"] for row in rows])),
    }
