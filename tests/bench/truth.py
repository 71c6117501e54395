"""The withheld truth: how fast linear cases are drawn, and how many draws are thrown away.

Seeds 60000 and up.
"""

import time
from collections import defaultdict
from pathlib import Path

from threadpoolctl import threadpool_limits

from truth import Cause, Plan, Wanted, draw_campaign, draw_protocol, read_station
from truth.campaign.case_design import RATIOS
from truth.effects import CATALOGUE
from tuning.workers.independent_calls import run_in_parallel

STATION = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"
CASES, JOBS, FIRST = 200, 2, 60_000
NONLINEAR = {"friction", "backlash", "hardening"}


def run() -> list[dict[str, object]]:
    """200 linear cases of the station, all protocols, on two processes."""
    names = [name for name in CATALOGUE if name not in NONLINEAR]
    start = time.perf_counter()
    calls = [
        (_drawn, (names[number % len(names)], RATIOS[number // len(names) % 4], FIRST + number))
        for number in range(CASES)
    ]
    timed_draws = list(run_in_parallel(calls, JOBS))
    whole = time.perf_counter() - start
    by_name: dict[str, list[tuple[float, int]]] = defaultdict(list)
    for name, seconds, discarded in timed_draws:
        by_name[name].append((seconds, discarded))
    rows = [_row(name, by_name[name]) for name in names]
    return [
        *rows,
        _row("all", [one for own in by_name.values() for one in own]) | {"wall s": whole},
    ]


def _drawn(name: str, ratio: float, seed: int) -> tuple[str, float, int]:
    with threadpool_limits(1):
        start = time.perf_counter()
        station = read_station(STATION)
        wanted = () if name == "none" else (Wanted(name, None, ratio),)
        plan = Plan(seed, Cause(wanted), draw_protocol(station, seed), rigid=2)
        campaign = draw_campaign(station, plan)
        return name, time.perf_counter() - start, campaign.discarded


def _row(name: str, found: list[tuple[float, int]]) -> dict[str, object]:
    discarded = sum(one for _, one in found)
    return {
        "effect": name,
        "n": len(found),
        "s a case": sum(seconds for seconds, _ in found) / len(found),
        "discarded": discarded,
        "discarded %": 100 * discarded / (discarded + len(found)),
        "wall s": "",
    }
