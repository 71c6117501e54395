"""The diagnosis of real machines: one fault or several beside instruments and imperfections.

Each row is one campaign of ``dirty_campaigns``, diagnosed by one process: a fault beside small
imperfections, imperfections alone, a wrong force channel, several faults, and for comparison exact
machines with one fault or none. ``dirty_rates`` makes the figures of them.

Seeds 650000 and up, on which the engine of the rows was not tuned. Rows that are done are kept, and
their order mixes all cells, so that any first part is balanced. In the environment:

* ``LIMIT=100``: rows of the first hundred designs only;
* ``CELLS=clean,nothing``: of these cells only;
* ``ENGINE=old``: rows in a file of their own, to compare two engines on the same campaigns. Make
  them in a checkout of the old commit and put the file beside the other;
* ``CAMPAIGNS=folder``: where drawn campaigns lie;
* ``JOBS=1``: processes.

``python -m tests.bench.dirty`` draws the campaigns and diagnoses nothing.
"""

import os
import resource
import subprocess
import sys
import time
import tomllib
from dataclasses import asdict
from functools import cache

from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose
from tests.bench.dirty_campaigns import Design, Stored, ensure, reported_designs
from tests.bench.dirty_rates import figures
from tests.bench.kept import cases, of
from tuning import open_session

FIRST = 650_000
EARLIER = (
    550_000,
    570_000,
    590_000,
    610_000,
    630_000,
)  # of former engines, which some of their failures shaped
ENGINES_COMPARED = "old"
LEAST_RATIO = 2**0.5  # survival ratio: below it lies the cell below 2, which nobody reports


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the figures of all rows."""
    designs, name = reported_designs(), _rows_name(os.environ.get("ENGINE", ""))
    jobs = int(os.environ.get("JOBS", "2"))
    cases(name, _chosen(designs), _case, jobs)
    return figures(list(of(name).values()), list(of(_rows_name(ENGINES_COMPARED)).values()))


def _rows_name(engine: str) -> str:
    return f"dirty.{FIRST}.{engine}" if engine else f"dirty.{FIRST}"


def _chosen(designs: tuple[Design, ...]) -> list[int]:
    """Return the numbers of the designs that the environment asks for."""
    limit = int(os.environ.get("LIMIT", len(designs)))
    cells = os.environ.get("CELLS", "")
    wanted = set(cells.split(",")) if cells else {design.cell for design in designs}
    return [n for n, design in enumerate(designs[:limit]) if design.cell in wanted]


def _case(number: int) -> dict[str, object]:
    """Diagnose the campaign of a design, which is drawn before if it is not there."""
    design = reported_designs()[number]
    stored = ensure(design, FIRST + number)
    row = {"seed": stored.seed, "commit": describe_commit(), **asdict(design)}
    if stored.answer is None:
        return row | {"left_out": "no place"}
    ratio = weakest_ratio(stored.answer)
    row |= {"answer": stored.answer.partition("\n[dirt]")[0], "drawn_ratio": ratio}
    if ratio is not None and ratio < LEAST_RATIO:
        return row | {"left_out": "hidden"}
    return row | {"items": dirt_items(stored.answer)} | diagnosed(stored)


def diagnosed(stored: Stored) -> dict[str, object]:
    """Return verdict and cost of a campaign's diagnosis, or the error that it ended with."""
    began, spent = time.perf_counter(), core_seconds()
    found: dict[str, object]
    with threadpool_limits(1):
        try:
            verdict = build_verdict(diagnose(open_session(stored.folder)))
            found = {"verdict": verdict.model_dump(mode="json")}
        except Exception as error:  # graded as a failure, the other cases go on
            found = {"error": f"{type(error).__name__}: {error}"}
    seconds = {"seconds": core_seconds() - spent, "wall": time.perf_counter() - began}
    return found | seconds


def weakest_ratio(answer: str) -> float | None:
    """Return the survival ratio of the fault that a refit hides most; None if none is stated."""
    told = tomllib.loads(answer)
    ratios = [cause.get("ratio") for cause in told.get("cause", [told])]
    return None if None in ratios else min(ratios)


def dirt_items(answer: str) -> list[str]:
    """Return effect and place of every small imperfection of an answer."""
    items = tomllib.loads(answer).get("dirt", {}).get("item", [])
    return sorted({f"{item['effect']}@{item['location']}" for item in items})


def core_seconds() -> float:
    """Return the processor time of this process and of its children that have ended [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


@cache
def describe_commit() -> str:
    """Return the commit of the tree that diagnoses; ``-dirty`` if files differ from it."""
    command = ("git", "describe", "--always", "--dirty", "--abbrev=7")
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def draw_all() -> int:
    """Draw the campaigns that are missing, in the order of the bench; return how many failed."""
    designs, failed = reported_designs(), 0
    for number in _chosen(designs):
        try:
            stored = ensure(designs[number], FIRST + number)
        except Exception as error:  # an effect that this version does not know, for one
            print(f"{number}: {error}", flush=True)
            failed += 1
            continue
        ratio = None if stored.answer is None else weakest_ratio(stored.answer)
        print(number, designs[number], ratio, f"{stored.seconds:.1f} s", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(min(draw_all(), 1))
