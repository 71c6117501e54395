"""NLopt, behind one function that keeps the best point whatever happens."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import nlopt
import numpy as np

from identification.words import Real, UsageError

Outcome = Literal["converged", "out of evaluations", "interrupted", "failed"]
Objective = Callable[[Real], tuple[float, Real]]


@dataclass(frozen=True, eq=False)
class Minimum:
    """The best point that a solver saw.

    Args:
        x: where; (n,).
        value: the objective there.
        evaluations: how many it took.
        outcome: how the search ended.
        advice: what to do about it; empty if nothing.
    """

    x: Real
    value: float
    evaluations: int
    outcome: Outcome
    advice: str


def minimise(
    objective: Objective,
    start: Real,
    bounds: tuple[Real, Real],
    *,
    algorithm: str = "LD_LBFGS",
    tolerance: float = 1e-6,
    max_evaluations: int = 400,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Minimise a smooth function with its gradient between bounds.

    The stopping rules count evaluations, never time. A keyboard interrupt ends the search and
    keeps the best point. NLopt's ``RoundoffLimited`` counts as converged.

    Args:
        objective: x to (value, gradient).
        start: within the bounds; (n,).
        bounds: lower and upper; (n,) each.
        algorithm: a gradient-based algorithm of NLopt, by name.
        tolerance: relative change of the value at which to stop.
        max_evaluations: at which to stop.
        report: told the evaluation's number and the best value so far.

    Raises:
        UsageError: an algorithm that NLopt does not have or that uses no gradient.
    """
    number = getattr(nlopt, algorithm, None)
    if number is None or not algorithm.startswith(("LD_", "GD_")):
        raise UsageError(f"{algorithm!r} is no gradient-based algorithm of NLopt: try LD_LBFGS")
    best = _Best(np.array(start, float))

    def evaluate(x: Real, gradient: Real) -> float:
        point = np.array(x)  # NLopt reuses its buffer
        value, slope = objective(point)
        best.evaluations += 1
        if value < best.value:
            best.x, best.value = point, value
        if report is not None:
            report(best.evaluations, best.value)
        if gradient.size:
            gradient[:] = slope
        return float(value)

    solver = nlopt.opt(number, len(start))
    solver.set_min_objective(evaluate)
    solver.set_lower_bounds(bounds[0])
    solver.set_upper_bounds(bounds[1])
    solver.set_ftol_rel(tolerance)
    solver.set_maxeval(max_evaluations)
    outcome, advice = _run(solver, np.clip(start, *bounds))
    return Minimum(best.x, float(best.value), best.evaluations, outcome, advice)


@dataclass
class _Best:
    """What the callback has seen so far: NLopt forgets it when an exception passes through."""

    x: Real
    value: float = np.inf
    evaluations: int = 0


def _run(solver: nlopt.opt, start: Real) -> tuple[Outcome, str]:
    try:
        solver.optimize(start)
    except KeyboardInterrupt:
        return "interrupted", "the best parameters so far are kept; run again to go on"
    except nlopt.RoundoffLimited:
        return "converged", ""
    except (RuntimeError, ValueError) as error:
        return "failed", f"the solver stopped ({error}); try other starts or a narrower band"
    if solver.last_optimize_result() == nlopt.MAXEVAL_REACHED:
        return "out of evaluations", "allow more evaluations"
    return "converged", ""
