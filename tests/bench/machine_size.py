"""Core seconds and peak memory of a machine by its number of bodies, with their exponents.

Each body has six springs and an accelerometer of three axes; the last one is hit along three axes,
and 51 lines are computed. A tuning varies all tolerances. Each step runs in a process of its own,
with one BLAS thread, so that its peak memory is that of loading the machine and of the step.

Rows that are done are kept: an interrupted bench continues with the next number of bodies.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from mbmodel import Evaluator, Machine, as_drawn, load_machine
from tests.bench.kept import cases, of
from tests.helpers.large_campaign import large_misfit, large_request
from tests.helpers.large_machine import large_mjcf

NAME = "machine_size"
BODIES = (10, 30, 60, 120, 200)
LINES = 51
LARGE = 60  # bodies from which the exponent is taken
_REPEATED = 30  # bodies up to which a step is measured three times, for its median


def run() -> list[dict[str, object]]:
    """Return core seconds and peak memory of all steps, and the exponents of both."""
    cases(NAME, BODIES, _case)
    rows = [row for _, row in sorted(of(NAME).items())]
    large = [row for row in rows if row["bodies"] >= LARGE]
    exponents = {key: _exponent(large, key) for key in rows[0] if key.endswith((" s", " GiB"))}
    return [
        *rows,
        {"bodies": "exponent", "parameters": _exponent(large, "parameters"), **exponents},
    ]


def _exponent(rows: list[dict], key: str) -> float:
    """Return the slope of the logarithm of a cost by the logarithm of the number of bodies."""
    bodies, costs = (np.log([row[name] for row in rows]) for name in ("bodies", key))
    return float(np.polyfit(bodies, costs, 1)[0])


def _case(bodies: int) -> dict[str, object]:
    """Return the costs of all steps for one machine."""
    row: dict[str, object] = {"bodies": bodies}
    for step in ("model", *STEPS):
        command = [sys.executable, "-m", "tests.bench.machine_size", step, str(bodies)]
        answer = subprocess.run(command, capture_output=True, text=True, check=True)
        row |= json.loads(answer.stdout)
    return row


def _measure(step: str, bodies: int) -> dict[str, object]:
    """Return seconds and peak memory of one step, in this process."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.xml"
        path.write_text(large_mjcf(bodies, sensors=1), encoding="utf-8")
        start = time.process_time()
        machine = load_machine(path)
        seconds, more = time.process_time() - start, {}
    if step in STEPS:
        seconds, more = STEPS[step](machine, 3 if bodies <= _REPEATED else 1)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {**more, f"{step} s": seconds, f"{step} GiB": memory}


def _compute_frfs(machine: Machine, repeats: int) -> tuple[float, dict[str, object]]:
    """FRFs, and their gradient by stiffness and damping."""
    model = as_drawn(machine)
    evaluator = Evaluator(model, large_request(machine, LINES))
    random = np.random.default_rng(0)
    theta = model.drawn * np.exp(0.1 * random.normal(size=len(model.drawn)))

    def frfs_with_gradient() -> None:
        lines = evaluator.at(theta)
        lines.gradient(random.normal(size=lines.values.shape) + 0j)

    return _time(frfs_with_gradient, repeats), {}


def _take_step(machine: Machine, repeats: int) -> tuple[float, dict[str, object]]:
    """One Gauss-Newton step: normal equations with all tolerances, and their solution."""
    misfit, x = large_misfit(machine, LINES)
    prior = np.where(misfit.parametrisation.is_tolerance, 1.0, 1e-6)

    def step() -> None:
        _, gradient, normal = misfit.quadratic_model(x)
        normal.solve(gradient, prior)

    return _time(step, repeats), {"parameters": len(x)}


def _time(work: Callable[[], None], repeats: int) -> float:
    """Return the median processor time of some work [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return float(np.median(times))


STEPS: dict[str, Callable[[Machine, int], tuple[float, dict[str, object]]]] = {
    "frfs": _compute_frfs,
    "step": _take_step,
}


if __name__ == "__main__":
    with threadpool_limits(1):
        print(json.dumps(_measure(sys.argv[1], int(sys.argv[2]))))
