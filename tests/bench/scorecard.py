"""The scorecard: every rate of the diagnosis on withheld machines, by one engine.

Each row is one campaign of ``scorecard_draws``, diagnosed by one process. ``scorecard_rates`` makes
the table of them. Seeds 810000 and up, on which the engine of the rows was not tuned. Rows that are
done are kept, and their order mixes all cells, so that any first part is balanced. In the
environment:

* ``LIMIT=100``: the first hundred designs only;
* ``CELLS="clean,nothing"``: these cells only;
* ``CAMPAIGNS=folder``: where drawn campaigns lie;
* ``JOBS=1``: processes.

``python -m tests.bench.scorecard`` draws the campaigns and diagnoses nothing.
"""

import os
import resource
import subprocess
import sys
import time
from dataclasses import asdict
from functools import cache
from pathlib import Path

from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose
from diagnosis.settings import SETTINGS, DiagnosisSettings
from tests.bench.kept import cases, of
from tests.bench.scorecard_draws import Stored, ensure, reported_designs
from tests.bench.scorecard_rates import rate_rows
from tuning import open_session

FIRST = 810_000
NAME = f"scorecard.{FIRST}"
ENGINE = ("identification", "mbmodel", "tuning", "diagnosis")  # packages that decide a verdict
LEAST_RATIO = 2**0.5  # survival ratio: what is below it is hidden, and nobody reports it


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the table of all rows."""
    cases(NAME, chosen_designs(), _case, int(os.environ.get("JOBS", "2")))
    return rate_rows(list(of(NAME).values()))


def chosen_designs() -> list[int]:
    """Return the numbers of the designs that the environment asks for."""
    designs = reported_designs()
    limit = int(os.environ.get("LIMIT", len(designs)))
    cells = os.environ.get("CELLS", "")
    wanted = set(cells.split(",")) if cells else {design.cell for design in designs}
    return [n for n, design in enumerate(designs[:limit]) if design.cell in wanted]


def _case(number: int) -> dict[str, object]:
    """Diagnose the campaign of a design, which is drawn before if it is not there."""
    design = reported_designs()[number]
    stored = ensure(design, FIRST + number)
    row = {"seed": stored.seed, "engine": describe_engine(), **asdict(design)}
    return row | diagnosed(stored)


def diagnosed(stored: Stored, settings: DiagnosisSettings = SETTINGS) -> dict[str, object]:
    """Return answer, verdict and cost of a campaign's diagnosis, or the error that it ended with.

    Campaigns without a place for their effects, and those whose fault is hidden, are left out.
    """
    if stored.answer is None:
        return {"left_out": "no place"}
    ratio = stored.weakest_ratio
    row: dict[str, object] = {"drawn_ratio": ratio}
    row["answer"] = stored.answer.partition("\n[dirt]")[0]
    if ratio is not None and ratio < LEAST_RATIO:
        return row | {"left_out": "hidden"}
    began, spent = time.perf_counter(), core_seconds()
    with threadpool_limits(1):
        try:
            verdict = build_verdict(diagnose(open_session(stored.folder), settings=settings))
            row["verdict"] = verdict.model_dump(mode="json")
        except Exception as error:  # graded as a failure, the other cases go on
            row["error"] = f"{type(error).__name__}: {error}"
    seconds = {"seconds": core_seconds() - spent, "wall": time.perf_counter() - began}
    return row | {"items": stored.dirt_items} | seconds


def core_seconds() -> float:
    """Return the processor time of this process and of its children that have ended [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


@cache
def describe_engine() -> str:
    """Return the last commit that changed the engine; ``-dirty`` if its files differ from it."""
    root = Path(__file__).parents[2]

    def ask(*command: str) -> str:
        whole = ["git", "-C", str(root), *command, "--", *ENGINE]
        return subprocess.run(whole, capture_output=True, text=True, check=True).stdout.strip()

    is_clean = not ask("status", "--porcelain")
    return ask("log", "-1", "--format=%h") + ("" if is_clean else "-dirty")


def draw_all() -> int:
    """Draw the campaigns that are missing, in the order of the bench; return how many failed."""
    designs, failed = reported_designs(), 0
    for number in chosen_designs():
        try:
            stored = ensure(designs[number], FIRST + number)
        except Exception as error:  # an effect that this version does not know, for one
            print(f"{number}: {error}", flush=True)
            failed += 1
            continue
        ratio = stored.weakest_ratio
        print(number, designs[number], ratio, f"{stored.seconds:.1f} s", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(min(draw_all(), 1))
