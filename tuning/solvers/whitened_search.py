"""Search by NLopt in coordinates that the normal equations whiten.

NLopt has no least-squares algorithm. Its gradient algorithms need few evaluations all the same, if
J is nearly |y|^2 / 2 in their coordinates y. With the normal equations N at a point x0, the
precision D of the prior and the damping l of Levenberg and Marquardt,

    x = x0 + Z z,    A = N + D + l diag(N + D),    Z' A Z = L L',    y = L' z,

the quadratic model of J is J0 + (L^-1 Z'g)'y + |y|^2 / 2. Its steepest descent is the step of
Levenberg and Marquardt (preconditioning by a change of variables; Nocedal and Wright 2006, ch. 5.1
and 10.3). What the model lacks, NLopt learns from the gradients of J, which are exact.

A whitened coordinate moves many parameters, so that bounds on parameters are no bounds on y. The
coordinates that the bounded step of the model puts on their limits therefore move together, in
proportion to that step: they share the last column of Z. Each other coordinate has a column of its
own. L' is upper triangular, so that the last y alone says how far they go, and it ends at their
limits. The first step of NLopt is then the bounded step. Whatever else crosses a limit is clipped
to it, and its gradient is zero, so that no evaluation lies outside the bounds.

The whitening holds near x0 only. No coordinate moves by more than its step limit (a factor of 2 in
stiffness) from x0. After two evaluations at which J differs from the quadratic model by more than
3 % of the predicted decrease, the search continues in coordinates whitened at the best point.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Real
from tuning.misfit.normal_equations import ArrowMatrix, QuadraticModel
from tuning.solvers.bounded_step import bounded_step
from tuning.solvers.gauss_newton import (
    MAX_DAMPING,
    MAX_PREDICTION_ERROR,
    MIN_DIAGONAL,
    Box,
    Problem,
)
from tuning.solvers.nlopt_solver import (
    INTERRUPTED_ADVICE,
    OUT_OF_EVALUATIONS_ADVICE,
    TUNING_ALGORITHM,
    Minimum,
    Outcome,
    find_algorithm,
    minimise,
)


@dataclass(frozen=True)
class _SearchLimits:
    """Constants of the search.

    Args:
        wrong_predictions: evaluations off the quadratic model after which it is formed anew. On the
            station from random starts, two needed fewer evaluations than one, three or four.
        evaluations: largest number of evaluations in one set of coordinates.
        good_ratio: of the predicted decrease, above which the damping falls tenfold.
        poor_ratio: of the predicted decrease, below which it rises tenfold.
        min_damping: lower bound of the damping.
        rounding: decrease relative to J that is below rounding errors.
    """

    wrong_predictions: int = 2
    evaluations: int = 20
    good_ratio: float = 0.5
    poor_ratio: float = 0.05
    min_damping: float = 1e-9
    rounding: float = 1e-9


_LIMITS = _SearchLimits()


@dataclass(frozen=True, eq=False)
class Whitening:
    """Coordinates y in which the quadratic model of J is |y|^2 / 2 and a linear term.

    Args:
        origin: x0, where y is zero; (n_x,).
        matrix: Z L'^-1; (n_x, n_y).
        end: y at which the limited coordinates reach their limits, infinite for others; (n_y,).
        lower: lower limits of the step x - x0; (n_x,).
        upper: upper limits of the step; (n_x,).
        predicted: decrease of J that the model predicts within the limits [nats].
    """

    origin: Real
    matrix: Real
    end: Real
    lower: Real
    upper: Real
    predicted: float

    def x(self, y: Real) -> Real:
        """Return the coordinates x within the limits; (n_x,)."""
        return self.origin + np.clip(self._step(y), self.lower, self.upper)

    def gradient(self, y: Real, slope: Real) -> Real:
        """Return the gradient by y from the one by x, zero where the limits clip; (n_y,)."""
        step = self._step(y)
        is_inside = (step >= self.lower) & (step <= self.upper)
        gradient: Real = self.matrix.T @ np.where(is_inside, slope, 0.0)
        return np.where(y <= self.end, gradient, 0.0)

    def _step(self, y: Real) -> Real:
        """Return the step x - x0 before it is clipped; (n_x,)."""
        return self.matrix @ np.minimum(y, self.end)


def whiten(x: Real, gradient: Real, normal: ArrowMatrix, box: Box, damping: float) -> Whitening:
    """Return the coordinates whitened by the normal equations at x.

    Args:
        x: point within the bounds; (n_x,).
        gradient: gradient of J there; (n_x,).
        normal: normal equations there, or nearby, without the prior.
        box: bounds, prior and step limits.
        damping: l.
    """
    lower = np.maximum(np.minimum(box.lower - x, 0.0), -box.step_limit)
    upper = np.minimum(np.maximum(box.upper - x, 0.0), box.step_limit)
    diagonal = normal.diagonal() + box.precision
    added = box.precision + damping * diagonal + MIN_DIAGONAL * float(diagonal.max(initial=1.0))
    step = bounded_step(normal, gradient, added, (lower, upper))
    weighted = normal.multiply(step) + box.precision * step
    predicted = -float(gradient @ step) - 0.5 * float(step @ weighted)
    is_limited = (step <= lower) | (step >= upper)
    columns = np.eye(len(x))[:, ~is_limited]
    has_shared = bool(step[is_limited].any())
    if has_shared:
        columns = np.column_stack([columns, np.where(is_limited, step, 0.0)])
    curvature = columns.T @ (normal.dense() + np.diag(added)) @ columns
    scale = 1.0 / np.sqrt(np.diag(curvature))
    factor = scipy.linalg.cholesky(curvature * np.outer(scale, scale), lower=True)
    matrix = scipy.linalg.solve_triangular(factor, (columns * scale).T, lower=True).T
    end = np.full(len(scale), np.inf)
    if has_shared:
        end[-1] = factor[-1, -1] / scale[-1]
    return Whitening(x, matrix, end, lower, upper, predicted)


@dataclass(frozen=True, eq=False)
class _Point:
    """Best point of a search, with J and its gradient.

    Args:
        x: the point; (n_x,).
        value: J.
        gradient: gradient of J; (n_x,).
    """

    x: Real
    value: float
    gradient: Real

    @property
    def is_finite(self) -> bool:
        """Whether J and its gradient are finite."""
        return bool(np.isfinite(self.value) and np.isfinite(self.gradient).all())


@dataclass(eq=False)
class _Search:
    """State of a search.

    Args:
        problem: function to minimise.
        box: bounds and prior.
        best: best point so far.
        damping: l.
        report: called with the number of evaluations and the best value so far.
        normal: normal equations at the best point or nearby; None if they are to be formed.
        is_new: whether the normal equations are those of the best point.
        evaluations: number of evaluations.
    """

    problem: Problem
    box: Box
    best: _Point
    damping: float
    report: Callable[[int, float], None] | None
    normal: ArrowMatrix | None = None
    is_new: bool = False
    evaluations: int = 0

    def form_normal_equations(self) -> ArrowMatrix:
        """Return the normal equations: those at hand if they hold, else those of the best point."""
        if self.normal is None:
            value, gradient, self.normal = self.problem.quadratic_model(self.best.x)
            self.best, self.is_new = _Point(self.best.x, value, gradient), True
            self.count_evaluation()
        return self.normal

    def evaluate(self, x: Real) -> tuple[float, Real]:
        """Return J and its gradient, and keep the point if it is the best."""
        x = np.clip(x, self.box.lower, self.box.upper)  # a sum with a limit can round beyond it
        value, gradient = self.problem(x)
        point = _Point(x, value, gradient)
        if point.is_finite and value < self.best.value:
            self.best = point
        self.count_evaluation()
        return value, gradient

    def adapt(self, ratio: float, *, keep: bool) -> None:
        """Adapt the damping after a decrease, and keep the normal equations or not.

        Args:
            ratio: decrease over the predicted one.
            keep: whether the normal equations predicted J.
        """
        if ratio > _LIMITS.good_ratio:
            self.damping = max(self.damping / 10, _LIMITS.min_damping)
        elif ratio < _LIMITS.poor_ratio:
            self.damping *= 10
        self.normal, self.is_new = (self.normal if keep else None), False

    def retry(self) -> None:
        """Prepare another try where J did not decrease: with new equations, or more damping."""
        if self.is_new:
            self.damping *= 10
        else:
            self.normal = None

    def count_evaluation(self) -> None:
        """Count an evaluation and report it."""
        self.evaluations += 1
        if self.report is not None:
            self.report(self.evaluations, self.best.value)

    def end(self, outcome: Outcome, advice: str = "") -> Minimum:
        """Return the best point as the result of the search."""
        return Minimum(self.best.x, self.best.value, self.evaluations, outcome, advice)


@dataclass(eq=False)
class _WhitenedObjective:
    """J by whitened coordinates; value and gradient at a point come from one evaluation.

    Args:
        search: search that evaluates J.
        whitening: the coordinates.
        model: J, its gradient and normal equations at their origin.
        y: point of the last evaluation; (n_y,).
        last: J and its gradient there, by y.
        wrong_predictions: evaluations so far at which J differed from the quadratic model.
    """

    search: _Search
    whitening: Whitening
    model: QuadraticModel
    y: Real
    last: tuple[float, Real]
    wrong_predictions: int = 0

    def __call__(self, y: Real) -> tuple[float, Real]:
        """Return J and its gradient by y."""
        if not np.array_equal(y, self.y):
            x = self.whitening.x(y)
            value, slope = self.search.evaluate(x)
            if not self._is_predicted(x, value):
                self.wrong_predictions += 1
            if not (np.isfinite(value) and np.isfinite(slope).all()):
                self.wrong_predictions = _LIMITS.wrong_predictions
                value, slope = np.inf, np.zeros(len(slope))
            self.y, self.last = y, (value, self.whitening.gradient(y, slope))
        return self.last

    def is_stale(self) -> bool:
        """Return whether the quadratic model, and so the whitening, holds no longer."""
        return self.wrong_predictions >= _LIMITS.wrong_predictions

    def _is_predicted(self, x: Real, value: float) -> bool:
        """Return whether the decrease of J is the predicted one, to within 3 %."""
        before, gradient, normal = self.model
        step = x - self.whitening.origin
        weighted = normal.multiply(step) + self.search.box.precision * step
        predicted = -float(gradient @ step) - 0.5 * float(step @ weighted)
        return abs(before - value - predicted) < MAX_PREDICTION_ERROR * abs(predicted)


def search_whitened(  # noqa: PLR0913  # one for each option
    problem: Problem,
    start: Real,
    box: Box,
    *,
    algorithm: str = TUNING_ALGORITHM,
    damping: float = 1e-3,
    min_gain_nats: float = 0.01,
    tolerance: float = 1e-7,
    max_whitenings: int = 60,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Minimise a sum of squares with priors within bounds, by NLopt in whitened coordinates.

    The stopping rules count evaluations, never time. A keyboard interrupt ends the search and keeps
    the best point.

    Args:
        start: start of the search, clipped to the bounds; (n,).
        algorithm: name of a gradient-based algorithm of NLopt.
        damping: initial damping l.
        min_gain_nats: the search ends when the next step is predicted to decrease J by less,
        tolerance: or by less than this part of J.
        max_whitenings: number of sets of whitened coordinates after which the search stops.
        report: called with the number of evaluations and the best value so far.

    Raises:
        UsageError: an algorithm that NLopt does not have or that uses no gradient.
    """
    find_algorithm(algorithm)  # refused even if the start is the minimum
    start = np.clip(start, box.lower, box.upper)
    search = _Search(problem, box, _Point(start, np.inf, np.zeros(len(start))), damping, report)
    try:
        for _ in range(max_whitenings):
            outcome = _advance(search, algorithm, min_gain_nats, tolerance)
            if outcome == "failed":
                return search.end("failed", "a value that is not finite")
            if outcome is not None:
                return search.end(outcome)
    except KeyboardInterrupt:
        return search.end("interrupted", INTERRUPTED_ADVICE)
    return search.end("out of evaluations", OUT_OF_EVALUATIONS_ADVICE)


def _advance(
    search: _Search, algorithm: str, min_gain_nats: float, tolerance: float
) -> Outcome | None:
    """Search in coordinates whitened at the best point; return how the search ended, if it did."""
    normal, before = search.form_normal_equations(), search.best
    if not before.is_finite:
        return "failed"
    whitening = whiten(before.x, before.gradient, normal, search.box, search.damping)
    min_decrease = min_gain_nats + tolerance * before.value
    if whitening.predicted < min_decrease:
        return "converged"
    n_y = whitening.matrix.shape[1]
    origin, unbounded = np.zeros(n_y), np.full(n_y, np.inf)
    objective = _WhitenedObjective(
        search,
        whitening,
        (before.value, before.gradient, normal),
        origin,
        (before.value, whitening.gradient(origin, before.gradient)),
    )
    result = minimise(
        objective,
        origin,
        (-unbounded, unbounded),
        algorithm=algorithm,
        tolerance=tolerance,
        min_change=min_gain_nats,
        max_evaluations=_LIMITS.evaluations,
        stop=objective.is_stale,
    )
    if result.outcome == "interrupted":
        raise KeyboardInterrupt
    decrease = before.value - search.best.value
    if decrease > 0:
        is_settled = search.is_new and not objective.is_stale() and decrease < min_decrease
        search.adapt(decrease / whitening.predicted, keep=not objective.wrong_predictions)
        return "converged" if is_settled else None
    is_rounding = whitening.predicted < _LIMITS.rounding * abs(before.value)
    if search.is_new and (is_rounding or search.damping > MAX_DAMPING):
        return "converged"
    search.retry()
    return None
