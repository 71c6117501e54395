"""Gauss-Newton method within bounds, with Levenberg-Marquardt damping.

Each step minimises a quadratic model of J within the bounds,

    min_d  g'd + 1/2 d'(N + D + l diag(N + D)) d,    lower <= x + d <= upper,

by an active-set method (``bounded_step``). D is the precision of the prior, l the damping. The
damping falls tenfold after a step that decreases J as predicted and rises tenfold after one that
does not (Nocedal and Wright 2006, ch. 10.3).

A small damping of large N holds back a step along which the data do not change and the prior alone
does. So the search ends only where a step without damping is predicted to gain too little as well:
a new N predicts that at the previous point, without another evaluation.

N is kept as long as steps decrease J as N predicts, to within 3 %. Only the gradient is then
computed anew, at a tenth of the cost. The minimum is as accurate, since the gradient alone
determines it.

If residuals are large, N lacks their curvature, and every step is too long by one factor: errors
alternate and fall slowly. A parabola through J, its slope and the value after the step then gives
the best length; a length that differs by 15 % or more is tried too (ch. 3.5), at the cost of one J.

If residuals rotate in the complex plane at constant size, N has a hundred times the curvature of J
along the bottom of a valley. Each step then covers a hundredth of the way, always as predicted.
In this case, if requested, the step is computed with the exact curvature of J, from differences of
its gradient. The method is conjugate gradients with N as the preconditioner (truncated Newton
method, Steihaug 1983; ch. 7.1). Most directions are solved in the first iteration, namely all but
the few for which N is wrong. A trust radius in units of the Gauss-Newton step limits the step, also
along directions of negative curvature.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.words import Real
from tuning.misfit.normal_equations import ArrowMatrix, QuadraticModel
from tuning.solvers.bounded_step import bounded_step
from tuning.solvers.nlopt_solver import (
    INTERRUPTED_ADVICE,
    OUT_OF_EVALUATIONS_ADVICE,
    Minimum,
    Outcome,
)

# Largest step of a coordinate without a prior: a factor of 2 in stiffness. It bounds each
# coordinate on its own: scaling the whole step would let a barely visible damping hold it back.
LARGEST_STEP = 0.7
MAX_PREDICTION_ERROR = 0.03  # of the predicted decrease: normal equations are kept up to here
_MAX_STEP_FACTOR = 2.0  # by which a line search may lengthen the Gauss-Newton step
_MIN_LENGTH_CHANGE = 0.15  # of a step: smaller corrections of its length are not tried
_STALLED_RATIO = 0.5  # of the previous predicted decrease: a step that predicts more has stalled
_MIN_CURVATURE_GAIN = 0.03  # of the stopping threshold: less predicted decrease is not worth CG
_MAX_CG_ITERATIONS = 12
_CG_TOLERANCE = 0.01  # of the squared initial residual in the preconditioner's metric
_GRADIENT_DIFFERENCE_STEP = 0.1  # of the Gauss-Newton step: between gradients compared
_RADIUS_FACTOR = 3.0  # by which the trust radius grows and shrinks
_MAX_RADIUS_TRIES = 3
MAX_DAMPING = 1e9  # beyond it, no step lowers J
LEAST_DAMPING = 1e-9  # counts as none
MIN_DIAGONAL = 1e-12  # of the largest diagonal: fixes directions that the data do not depend on


class Problem(Protocol):
    """Function to minimise, with its Gauss-Newton model."""

    def __call__(self, x: Real) -> tuple[float, Real]:
        """Return J and its gradient."""

    def value(self, x: Real) -> float:
        """Return J."""

    def quadratic_model(self, x: Real) -> QuadraticModel:
        """Return J, its gradient, and the normal equations without the prior."""


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds of x, and the precision of its prior.

    Args:
        lower: lower bounds; (n,).
        upper: upper bounds; (n,).
        precision: 1 for a coordinate with a prior, else 0; (n,).
        max_step: largest step of each coordinate; if None, 0.7 without a prior; (n,).
    """

    lower: Real
    upper: Real
    precision: Real
    max_step: Real | None = None

    @property
    def step_limit(self) -> Real:
        """Largest step of each coordinate; (n,)."""
        if self.max_step is not None:
            return self.max_step
        return np.where(self.precision == 0, LARGEST_STEP, np.inf)


@dataclass
class _State:
    """Current state of a search."""

    x: Real
    damping: float = 1e-3
    evaluations: int = 0
    is_stalled: bool = False
    radius: float = 10.0  # trust radius of steps by exact curvature [Gauss-Newton steps]


def gauss_newton(  # noqa: PLR0913  # one for each option
    problem: Problem,
    start: Real,
    box: Box,
    *,
    initial_normal: ArrowMatrix | None = None,
    damping: float = 1e-3,
    min_gain_nats: float = 0.01,
    tolerance: float = 1e-7,
    max_steps: int = 60,
    exact_curvature: bool = False,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Minimise a sum of squares with priors within bounds.

    The stopping rules count steps, never time. A keyboard interrupt ends the search and keeps the
    best point.

    Args:
        start: start of the search, clipped to the bounds; (n,).
        initial_normal: normal equations near the start or of fewer lines, if available; they are
            kept as long as steps decrease J as predicted.
        damping: initial damping l; small if the start is close to the minimum.
        min_gain_nats: the search ends when the next step is predicted to decrease J by less,
        tolerance: or by less than this part of J.
        max_steps: number of steps after which the search stops.
        exact_curvature: whether stalled steps are replaced by steps with the exact curvature of J.
        report: called with the number of evaluations and the best value so far.
    """
    state = _State(np.clip(start, box.lower, box.upper), damping)
    value, before = np.inf, {True: 0.0, False: 0.0}  # last prediction, by whether N was new
    is_last = False  # whether no step since one without damping has gained anything
    kept_normal = initial_normal  # None: N is to be formed at the next point
    try:
        for _ in range(max_steps):
            is_new = kept_normal is None
            here = (
                problem.quadratic_model(state.x)
                if kept_normal is None
                else (*problem(state.x), kept_normal)
            )
            state.evaluations += 1
            x, (previous, gradient, normal) = state.x, here
            if report is not None:
                report(state.evaluations, previous)
            if not (np.isfinite(previous) and np.isfinite(gradient).all()):
                return _minimum(state, previous, "failed", "a value that is not finite")
            min_decrease = min_gain_nats + tolerance * previous
            predicted, value = _advance(
                problem, state, box, here, min_decrease, retry_shorter=is_new
            )
            # The predicted decreases of good steps fall at a steady rate, which gives that of the
            # next step.
            state.is_stalled = exact_curvature and predicted > _STALLED_RATIO * before[is_new] > 0
            is_steady = before[is_new] > 0 and previous - value > 0.5 * predicted
            rate = min(predicted / before[is_new], 1.0) if is_steady else 1.0
            if predicted * rate < min_decrease and not (
                state.is_stalled and previous - value > min_decrease
            ):
                undamped = _model_step(x, box, here, LEAST_DAMPING).decrease
                if is_last or (is_new and undamped - predicted < min_decrease):
                    return _minimum(state, value, "converged", "")
                # Damping hides what is left where a prior alone tells parameters apart.
                state.damping, is_last = LEAST_DAMPING, True
                kept_normal, before = normal, {True: 0.0, False: 0.0}
                continue
            is_last = is_last and previous - value <= min_decrease
            before[is_new] = predicted
            is_predicted = (
                abs(previous - value - predicted) < MAX_PREDICTION_ERROR * predicted + min_gain_nats
            )
            # A kept N that stalls predicts a crawl rightly for ever: only a new one ends it.
            if is_predicted and (is_new or not state.is_stalled):
                kept_normal = normal
            else:
                kept_normal, before[False] = None, 0.0
    except KeyboardInterrupt:
        return _minimum(state, value, "interrupted", INTERRUPTED_ADVICE)
    return _minimum(state, value, "out of evaluations", OUT_OF_EVALUATIONS_ADVICE)


def _advance(
    problem: Problem,
    state: _State,
    box: Box,
    here: QuadraticModel,
    min_decrease: float,
    *,
    retry_shorter: bool,
) -> tuple[float, float]:
    """Take one step that decreases J.

    Args:
        state: state of the search, which is updated.
        here: J, its gradient and N at the current point.
        min_decrease: decrease of J below which the search ends [nats].
        retry_shorter: whether a step that does not decrease J is repeated with more damping;
            not if N is old.

    Returns:
        The predicted decrease [nats], zero if no step decreases J, and the new J.
    """
    value, gradient, _ = here
    while state.damping < MAX_DAMPING:
        model = _model_step(state.x, box, here, state.damping)
        step, predicted = model.step, model.decrease
        # The accepted point itself, whose model the derivatives need next.
        trial_value = problem.value(np.clip(state.x + step, box.lower, box.upper))
        state.evaluations += 1
        if np.isfinite(trial_value) and value - trial_value > 0.05 * predicted > 0:
            if value - trial_value > 0.5 * predicted:
                state.damping = max(state.damping / 10, LEAST_DAMPING)
            if (
                retry_shorter
                and state.is_stalled
                and predicted > _MIN_CURVATURE_GAIN * min_decrease
            ):
                trial_step, new_value = _curvature_step(problem, state, here, model, trial_value)
                if new_value < trial_value:
                    state.x = np.clip(state.x + trial_step, box.lower, box.upper)
                    return predicted, new_value
            length = _best_length(float(gradient @ step), trial_value - value)
            if abs(length - 1) > _MIN_LENGTH_CHANGE and predicted > min_decrease:
                trial_step = np.clip(length * step, model.lower, model.upper)
                new_value = problem.value(np.clip(state.x + trial_step, box.lower, box.upper))
                state.evaluations += 1
                if new_value < trial_value:
                    trial_value, step = new_value, trial_step
            state.x = np.clip(state.x + step, box.lower, box.upper)
            return predicted, trial_value
        if predicted < 1e-9 * abs(value):  # below rounding errors of J
            return 0.0, value
        if not retry_shorter:
            return predicted, value
        state.damping *= 10
    state.damping = 1e-3
    return 0.0, value


@dataclass(frozen=True, eq=False)
class _ModelStep:
    """Step to the minimum of the quadratic model within bounds.

    Args:
        step: d; (n,).
        decrease: predicted decrease of J, damping left out [nats].
        added: added to N's diagonal; (n,).
        lower: lower bounds of d; (n,).
        upper: upper bounds of d; (n,).
    """

    step: Real
    decrease: float
    added: Real
    lower: Real
    upper: Real


def _model_step(x: Real, box: Box, here: QuadraticModel, damping: float) -> _ModelStep:
    """Return the step from x that the quadratic model gives under a damping."""
    _, gradient, normal = here
    diagonal = normal.diagonal() + box.precision
    least = MIN_DIAGONAL * float(diagonal.max(initial=1.0))
    added = box.precision + damping * diagonal + least
    lower = np.maximum(box.lower - x, -box.step_limit)
    upper = np.minimum(box.upper - x, box.step_limit)
    step = bounded_step(normal, gradient, added, (lower, upper))
    curvature = float(step @ (normal.multiply(step) + box.precision * step))
    return _ModelStep(step, -float(gradient @ step) - 0.5 * curvature, added, lower, upper)


def _curvature_step(
    problem: Problem,
    state: _State,
    here: QuadraticModel,
    model: _ModelStep,
    newton_value: float,
) -> tuple[Real, float]:
    """Return a step with the exact curvature of J and the J it leads to.

    If no such step is better than the Gauss-Newton step, that step is returned.

    Args:
        state: state of the search.
        here: J, its gradient and N.
        model: Gauss-Newton step.
        newton_value: J after that step.
    """
    step = model.step
    correction = _solve_by_cg(problem, state, here, model)
    state.radius *= _RADIUS_FACTOR
    for _ in range(_MAX_RADIUS_TRIES):
        trial_step = np.clip(step + correction, model.lower, model.upper)
        new_value = problem.value(state.x + trial_step)
        state.evaluations += 1
        if new_value < newton_value:
            return trial_step, new_value
        correction, state.radius = (
            correction / _RADIUS_FACTOR,
            max(state.radius / _RADIUS_FACTOR, 1.0),
        )
    return step, newton_value


def _solve_by_cg(problem: Problem, state: _State, here: QuadraticModel, model: _ModelStep) -> Real:
    """Return the correction of the Gauss-Newton step by preconditioned conjugate gradients.

    Coordinates that the Gauss-Newton step has put on bounds stay there.
    """
    _, slope, normal = here
    step, added = model.step, model.added
    free = (step > model.lower) & (step < model.upper)

    def metric(first: Real, second: Real) -> float:
        return float(first @ (normal.multiply(second) + added * second))

    size = np.sqrt(metric(step, step))

    def curvature_product(direction: Real) -> Real:
        """Return the Hessian of J times a direction."""
        distance = _GRADIENT_DIFFERENCE_STEP * size / np.sqrt(metric(direction, direction))
        state.evaluations += 1
        return np.where(free, problem(state.x + distance * direction)[1] - slope, 0.0) / distance

    solution: Real = np.zeros(len(step))
    residual = np.where(free, -slope, 0.0) - curvature_product(step)
    preconditioned = normal.solve(residual, added, free)
    direction, power = preconditioned, float(residual @ preconditioned)
    tolerance = _CG_TOLERANCE * power
    for _ in range(_MAX_CG_ITERATIONS):
        if not power > tolerance > 0:
            break
        product = curvature_product(direction)
        curvature, direction_norm = float(direction @ product), metric(direction, direction)
        projection, outside = (
            metric(solution, direction),
            metric(solution, solution) - (state.radius * size) ** 2,
        )
        to_boundary = (
            float(np.sqrt(projection**2 - direction_norm * outside) - projection) / direction_norm
        )
        if curvature * to_boundary <= power:
            return solution + to_boundary * direction
        solution = solution + power / curvature * direction
        residual = residual - power / curvature * product
        preconditioned = normal.solve(residual, added, free)
        power, previous = float(residual @ preconditioned), power
        direction = preconditioned + power / previous * direction
    return solution


def _best_length(slope: float, change: float) -> float:
    """Return the minimum of a parabola from its slope at 0 and its change from 0 to 1."""
    curvature = change - slope
    return min(-slope / (2 * curvature), _MAX_STEP_FACTOR) if curvature > 0 else _MAX_STEP_FACTOR


def _minimum(state: _State, value: float, outcome: Outcome, advice: str) -> Minimum:
    """Return the result of a search that has ended."""
    return Minimum(state.x, value, state.evaluations, outcome, advice)
