"""NLopt (Johnson) behind one function that keeps the best point however the search ends."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import nlopt
import numpy as np

from identification.words import Real, UsageError

Outcome = Literal["converged", "out of evaluations", "interrupted", "failed"]
INTERRUPTED_ADVICE = "the best parameters so far are kept"
OUT_OF_EVALUATIONS_ADVICE = (
    "fix parameters that the data do not determine, try more starts or more evaluations"
)
# Of the algorithms of NLopt, it needs the fewest evaluations and next to no arithmetic of its own:
# ``make bench ONLY=algorithms``.
TUNING_ALGORITHM = "LD_LBFGS"
Objective = Callable[[Real], tuple[float, Real]]


@dataclass(frozen=True, eq=False)
class Minimum:
    """Best point that a solver evaluated.

    Args:
        x: best point; (n,).
        value: objective there.
        evaluations: number of evaluations.
        outcome: how the search ended.
        advice: what to do about the outcome; empty if nothing.
    """

    x: Real
    value: float
    evaluations: int
    outcome: Outcome
    advice: str


def minimise(  # noqa: PLR0913  # one for each option
    objective: Objective,
    start: Real,
    bounds: tuple[Real, Real],
    *,
    algorithm: str = TUNING_ALGORITHM,
    tolerance: float = 1e-6,
    min_change: float = 0.0,
    max_evaluations: int = 400,
    stop: Callable[[], bool] | None = None,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Minimise a smooth function with its gradient within bounds.

    The stopping rules count evaluations, never time. A keyboard interrupt ends the search and
    keeps the best point. NLopt's ``RoundoffLimited`` counts as converged.

    Args:
        objective: function from x to its value and gradient.
        start: start of the search, clipped to the bounds; (n,).
        bounds: lower and upper bounds; (n,) each.
        algorithm: name of a gradient-based algorithm of NLopt.
        tolerance: relative change of the value at which the search stops.
        min_change: absolute change of the value at which it stops.
        max_evaluations: number of evaluations at which the search stops.
        stop: called after each evaluation; whether the search ends there.
        report: called with the number of evaluations and the best value so far.

    Raises:
        UsageError: an algorithm that NLopt does not have or that uses no gradient.
    """
    best = _Best(np.array(start, float))
    solver = nlopt.opt(find_algorithm(algorithm), len(start))

    def evaluate(x: Real, gradient: Real) -> float:
        if best.is_stopped or best.error is not None:  # NLopt asks once more after a forced stop
            return np.inf
        point = np.array(x)  # NLopt reuses its buffer
        try:
            value, slope = objective(point)
            best.update(point, float(value))
            if report is not None:
                report(best.evaluations, best.value)
            if stop is not None and stop():
                best.is_stopped = True
                solver.force_stop()
        except BaseException as error:
            # NLopt would hide it behind an error of its own: keep it, stop, raise it afterwards.
            best.error = error
            solver.force_stop()
            return np.inf
        if gradient.size:
            gradient[:] = slope
        return float(value)

    solver.set_min_objective(evaluate)
    solver.set_lower_bounds(bounds[0])
    solver.set_upper_bounds(bounds[1])
    solver.set_ftol_rel(tolerance)
    solver.set_ftol_abs(min_change)
    solver.set_maxeval(max_evaluations)
    outcome, advice = _run(solver, np.clip(start, *bounds), best)
    return Minimum(best.x, best.value, best.evaluations, outcome, advice)


def find_algorithm(algorithm: str) -> int:
    """Return NLopt's number of a gradient-based algorithm.

    Raises:
        UsageError: an algorithm that NLopt does not have or that uses no gradient.
    """
    number: int | None = getattr(nlopt, algorithm, None)
    if number is None or not algorithm.startswith(("LD_", "GD_")):
        raise UsageError(f"{algorithm!r} is no gradient-based algorithm of NLopt: try LD_LBFGS")
    return number


@dataclass
class _Best:
    """Best point of the evaluations so far."""

    x: Real
    value: float = np.inf
    evaluations: int = 0
    error: BaseException | None = None
    is_stopped: bool = False

    def update(self, point: Real, value: float) -> None:
        """Count an evaluation, and keep its point if it is the best."""
        self.evaluations += 1
        if value < self.value:
            self.x, self.value = point, value


def _run(solver: nlopt.opt, start: Real, best: _Best) -> tuple[Outcome, str]:
    """Run the solver; return the outcome and the advice."""
    failure = ""
    try:
        solver.optimize(start)
    except (nlopt.RoundoffLimited, nlopt.ForcedStop):
        pass
    except (nlopt.exception, RuntimeError, ValueError) as error:
        failure = str(error) if isinstance(error, ValueError) else "a value that is not finite"
    except KeyboardInterrupt as error:  # between two evaluations
        best.error = error
    if isinstance(best.error, KeyboardInterrupt):
        return "interrupted", INTERRUPTED_ADVICE
    if best.error is not None:
        raise best.error
    if failure or not np.isfinite(best.value):
        return "failed", f"the solver stopped ({failure}); try other starts or a narrower band"
    if solver.last_optimize_result() == nlopt.MAXEVAL_REACHED:
        return "out of evaluations", OUT_OF_EVALUATIONS_ADVICE
    return "converged", ""
