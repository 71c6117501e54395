"""Do the 95 % bands of FRFs hold between ports that no test measured? Machines of ``truth/``.

Motors along joints and pairs of forces are inputs. Joints, a point without a sensor, a difference
of two points, a sensor (its true place and axes) and the place where it is drawn are outputs.
Machines are clean or have small imperfections that leave 5 or 15 % of the motion of a re-tuned
machine (``python -m truth --dirt``). Three of four are trees of three stages, one is the station.
Those with imperfections are diagnosed too: their plant then has the established causes, and its
bands span all plants of a probability of 5 % or more.
Seeds 662000 and up; 620000 to 620028 shaped the discrepancy. Intervals are those of the bootstrap
over machines.

Rows that are done are kept, and their order mixes all cells. In the environment: ``LIMIT=60`` for
the first sixty, ``JOBS=1`` for the number of processes.
"""

import os
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tests.bench.kept import cases, of
from tests.helpers.plant_coverage import plant_coverage
from truth import Plan, Protocol, TruthError, read_station
from truth.machine.random_tree import draw_tree
from tuning import NORMAL_QUANTILE_95

MACHINES, FIRST = 600, 662_000
NAME = f"plant_coverage.{FIRST}"
DIRT = (0.0, 5.0, 15.0)
KINDS = ("magnitude", "phase", "at joints", "at points", "at a sensor", "at its drawn place")
_DRAWS = 10_000  # of the bootstrap
_STATION_EVERY = 4  # machines of one dirt
_STAGES, _LINES, _RESOLUTION_HZ = 3, 201, 1.0  # of trees
_STATION = Path(__file__).resolve().parents[2] / "assets" / "microstation" / "station.xml"


def run() -> list[dict[str, object]]:
    """Draw, tune and count what is missing; return the coverage of all rows."""
    limit = int(os.environ.get("LIMIT", MACHINES))
    jobs = int(os.environ.get("JOBS", "1"))
    cases(NAME, range(min(limit, MACHINES)), _case, jobs, _lacks_diagnosis)
    rows = [row for row in of(NAME).values() if "failed" not in row]
    return [
        _row(dirt, plant, kind, rows)
        for dirt in DIRT
        for plant in ("tuned", "diagnosed")
        if dirt or plant == "tuned"
        for kind in KINDS
    ]


def _lacks_diagnosis(row: dict) -> bool:
    """Whether a row of a machine with imperfections was made by a tuning alone."""
    return bool(row.get("dirt")) and "after" not in row and "failed" not in row


def _case(number: int) -> dict[str, object]:
    """Return the counts of one machine."""
    seed, dirt = FIRST + number, DIRT[number % len(DIRT)]
    is_station = number // len(DIRT) % _STATION_EVERY == _STATION_EVERY - 1
    with threadpool_limits(1):
        if is_station:
            nominal, protocol = read_station(_STATION), Protocol()
        else:
            nominal = draw_tree(seed, _STAGES)
            protocol = Protocol((nominal.first_aim(),), lines=_LINES, resolution_hz=_RESOLUTION_HZ)
        try:
            plan = Plan(seed, protocol=protocol, dirt=dirt)
            row = plant_coverage(nominal, plan, is_diagnosed=dirt > 0)
        except TruthError as error:
            return {"seed": seed, "dirt": dirt, "failed": str(error)}
    return {"machine": "station" if is_station else "tree", **row}


def _row(dirt: float, plant: str, kind: str, rows: list[dict]) -> dict[str, object]:
    """Mean coverage over machines, with its bootstrap interval; width and error of the bands."""
    chosen = [row for row in rows if row["dirt"] == dirt]
    if plant == "diagnosed":
        chosen = [row["after"] for row in chosen if "after" in row]
    if not chosen:
        return {"dirt %": dirt, "plant": plant, "of": kind, "machines": 0}
    held, size, width, error = np.array([row[kind] for row in chosen]).T
    each = held / size
    draws = np.random.default_rng(0).integers(len(each), size=(_DRAWS, len(each)))
    low, high = np.percentile(each[draws].mean(axis=1), (2.5, 97.5))
    return {
        "dirt %": dirt,
        "plant": plant,
        "of": kind,
        "machines": len(chosen),
        "n": int(size.sum()),
        "coverage %": 100 * float(each.mean()),
        "from": 100 * float(low),
        "to": 100 * float(high),
        "median width %": 100 * NORMAL_QUANTILE_95 * float(np.median(width)),
        "median error %": 100 * float(np.median(error)),
    }
