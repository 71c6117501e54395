r"""Gauss-Newton between bounds, damped as by Levenberg and Marquardt.

Each step minimises the quadratic model inside the bounds,

    min_d  g'd + 1/2 d'(N + D + l diag(N + D)) d,    lower <= x + d <= upper,

by an active set: what would cross a bound is put on it, what a bound holds back against the slope
is let go. D is the prior's precision, l the damping, which falls by ten when a step does what its
model promises and rises by ten when it does not (Nocedal and Wright 2006, ch. 10.3 and 16.5). As
long as steps do what N promises to 3 %, N is kept and only the gradient computed anew, which
costs a tenth of it: the end is as sharp, since the gradient alone says where it is.

Where residuals are large N lacks their curvature, and each step goes too far by the same factor:
errors shrink slowly, to and fro. A step of which a parabola through J, its slope and what was
reached says that it should have been longer or shorter by 15 % is tried at that length too (ch.
3.5), which costs one J.

Where residuals turn while their size stays, N has a hundred times the curvature of J along the
bottom of a valley, and each step goes a hundredth of the way, always as promised. There, on demand,
conjugate gradients solve for the step with J's own curvature, which differences of its gradient
tell, and with N as the preconditioner (Steihaug 1983; ch. 7.1): all but the few directions that N
gets wrong are done in the first of their rounds. It goes no farther than a trust radius in units
of the Gauss-Newton step, along directions without curvature as far as that.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.words import Mask, Real
from tuning.misfit.normal_equations import Arrow, Quadratic
from tuning.solvers.nlopt_solver import INTERRUPTED, Minimum, Outcome

# Of a coordinate without a prior: a factor of 2 in stiffness. As a bound of each coordinate, not a
# scale of the whole step, which one hardly visible damping would hold back.
LARGEST_STEP = 0.7
_KEPT = 0.03  # by which a step may miss its promise for the normal equations to be kept
_LONGEST = 2.0  # of what N says, that a step may become
_OFF = 0.15  # by which a step's best length must miss it for another to be tried
_CREEPS = 0.5  # of what the step before promised: who promises more hardly comes nearer
_SLIGHT = 0.03  # of what is enough, that a step may promise whose curvature is asked for
_ROUNDS_OF_CG = 12
_SOLVED = 0.01  # of the gradient, in the metric of the preconditioner, that they may leave
_DIFFERENCE = 0.1  # of the Gauss-Newton step, over which gradients are compared
_SHORTER = 3.0  # times, while a longer step does not help, and how often
_TRIES = 3
_STUCK = 1e9  # damping at which no step helps any more
_ROUNDS = 200
_FLAT = 1e-12  # of the largest diagonal: keeps directions that nothing sees where they are


class Problem(Protocol):
    """What is minimised."""

    def __call__(self, x: Real) -> tuple[float, Real]:
        """J and its gradient."""

    def value(self, x: Real) -> float:
        """J."""

    def normal(self, x: Real) -> Quadratic:
        """J, its gradient, the normal equations without the prior."""


@dataclass(frozen=True, eq=False)
class Box:
    """Where x may lie, and the precision of its prior.

    Args:
        lower, upper: (n,).
        precision: 1 where a prior counts, else 0; (n,).
        farthest: how far one step may go; by default 0.7 where no prior counts; (n,).
    """

    lower: Real
    upper: Real
    precision: Real
    farthest: Real | None = None

    @property
    def limit(self) -> Real:
        """How far one step may go; (n,)."""
        if self.farthest is not None:
            return self.farthest
        return np.where(self.precision == 0, LARGEST_STEP, np.inf)


@dataclass
class _State:
    """Where a search stands."""

    x: Real
    damping: float = 1e-3
    evaluations: int = 0
    creeping: bool = False
    radius: float = 10.0  # of a step by J's own curvature, in Gauss-Newton steps


def gauss_newton(  # noqa: PLR0913  # one for each option
    problem: Problem,
    start: Real,
    box: Box,
    *,
    known: Arrow | None = None,
    damping: float = 1e-3,
    promise: float = 0.01,
    tolerance: float = 1e-7,
    max_steps: int = 60,
    curved: bool = False,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Minimise a sum of squares.

    The stopping rules count steps, never time. A keyboard interrupt ends the search and keeps the
    best point.

    Args:
        problem: with its normal equations.
        start: (n,); clipped to the box.
        box: bounds and prior.
        known: normal equations near the start, or of fewer lines, where somebody has them: kept
            as long as steps do what they promise.
        damping: l at first; next to none where the start is near the end.
        promise: it ends when the next step will promise less, in nats;
        tolerance: or less than this part of J.
        max_steps: at which to stop.
        curved: whether steps that creep are made longer by J's own curvature.
        report: told the evaluation's number and the best value so far.
    """
    state = _State(np.clip(start, box.lower, box.upper), damping)
    value, before = np.inf, {True: 0.0, False: 0.0}  # promised last, with N fresh or kept
    kept = known  # None where N is to be made anew
    try:
        for _ in range(max_steps):
            fresh = kept is None
            here = problem.normal(state.x) if kept is None else (*problem(state.x), kept)
            state.evaluations += 1
            old, gradient, normal = here
            if report is not None:
                report(state.evaluations, old)
            if not (np.isfinite(old) and np.isfinite(gradient).all()):
                return _ended(state, old, "failed", "a value that is not finite")
            enough = promise + tolerance * old
            promised, value = _advance(problem, state, box, here, enough, patient=fresh)
            # Steps that do what they promise shrink at a steady rate: the next of their kind will
            # promise less than this by as much again.
            state.creeping = curved and promised > _CREEPS * before[fresh] > 0
            steady = before[fresh] > 0 and old - value > 0.5 * promised
            rate = min(promised / before[fresh], 1.0) if steady else 1.0
            if promised * rate < enough and not (state.creeping and old - value > enough):
                return _ended(state, value, "converged", "")
            before[fresh] = promised
            if abs(old - value - promised) < _KEPT * promised + promise:
                kept = normal
            else:
                kept, before[False] = None, 0.0
    except KeyboardInterrupt:
        return _ended(state, value, "interrupted", INTERRUPTED)
    return _ended(state, value, "out of evaluations", "allow more evaluations")


def _advance(
    problem: Problem,
    state: _State,
    box: Box,
    here: Quadratic,
    enough: float,
    *,
    patient: bool,
) -> tuple[float, float]:
    """Take one step that helps; what it promised, in nats, zero if none helps, and the new J.

    Without patience, for which N is too old, a step that does not help is not tried shorter.
    """
    value, gradient, normal = here
    diagonal = normal.diagonal() + box.precision
    least = _FLAT * float(diagonal.max(initial=1.0))
    limit = box.limit
    while state.damping < _STUCK:
        added = box.precision + state.damping * diagonal + least
        lower = np.maximum(box.lower - state.x, -limit)
        upper = np.minimum(box.upper - state.x, limit)
        step = bounded_step(normal, gradient, added, (lower, upper))
        pressed = normal.times(step) + box.precision * step
        slope = float(gradient @ step)
        promised = -slope - 0.5 * float(step @ pressed)
        found = problem.value(state.x + step)
        state.evaluations += 1
        if np.isfinite(found) and value - found > 0.05 * promised > 0:
            if value - found > 0.5 * promised:
                state.damping = max(state.damping / 10, 1e-9)
            if patient and state.creeping and promised > _SLIGHT * enough:
                known = step, lower, upper
                other, reached = _farther(problem, state, here, added, known, found)
                if reached < found:
                    state.x = np.clip(state.x + other, box.lower, box.upper)
                    return promised, reached
            length = _best_length(slope, found - value)
            if abs(length - 1) > _OFF and promised > enough:
                other = np.clip(length * step, lower, upper)
                reached = problem.value(state.x + other)
                state.evaluations += 1
                if reached < found:
                    found, step = reached, other
            state.x = np.clip(state.x + step, box.lower, box.upper)
            return promised, found
        if promised < 1e-9 * abs(value):  # rounding decides
            return 0.0, value
        if not patient:
            return promised, value
        state.damping *= 10
    state.damping = 1e-3
    return 0.0, value


def _farther(
    problem: Problem,
    state: _State,
    here: Quadratic,
    added: Real,
    known: tuple[Real, Real, Real],
    least: float,
) -> tuple[Real, float]:
    """A step by J's own curvature, and J there; the one that is known if none is lower.

    Args:
        problem: what is minimised.
        state: where.
        here: J, its gradient and N.
        added: to N's diagonal.
        known: Gauss-Newton's step and its bounds.
        least: J after that step.
    """
    step, lower, upper = known
    aim = _by_curvature(problem, state, here, added, known)
    state.radius *= _SHORTER
    for _ in range(_TRIES):
        farther = np.clip(step + aim, lower, upper)
        reached = problem.value(state.x + farther)
        state.evaluations += 1
        if reached < least:
            return farther, reached
        aim, state.radius = aim / _SHORTER, max(state.radius / _SHORTER, 1.0)
    return step, least


def _by_curvature(
    problem: Problem,
    state: _State,
    here: Quadratic,
    added: Real,
    known: tuple[Real, Real, Real],
) -> Real:
    """What conjugate gradients add to Gauss-Newton's step; what it has put on bounds stays."""
    _, slope, normal = here
    step, lower, upper = known
    free = (step > lower) & (step < upper)

    def metric(one: Real, other: Real) -> float:
        return float(one @ (normal.times(other) + added * other))

    size = np.sqrt(metric(step, step))

    def bent(way: Real) -> Real:
        """J's second derivatives times a way."""
        near = _DIFFERENCE * size / np.sqrt(metric(way, way))
        state.evaluations += 1
        changed: Real = np.where(free, problem(state.x + near * way)[1] - slope, 0.0) / near
        return changed

    found: Real = np.zeros(len(step))
    left = np.where(free, -slope, 0.0) - bent(step)
    better = normal.solve(left, added, free)
    way, power = better, float(left @ better)
    enough = _SOLVED * power
    for _ in range(_ROUNDS_OF_CG):
        if not power > enough > 0:
            break
        pressed = bent(way)
        bend, length = float(way @ pressed), metric(way, way)
        across, beyond = metric(found, way), metric(found, found) - (state.radius * size) ** 2
        edge = float(np.sqrt(across**2 - length * beyond) - across) / length
        if bend * edge <= power:
            return found + edge * way
        found = found + power / bend * way
        left = left - power / bend * pressed
        better = normal.solve(left, added, free)
        power, before = float(left @ better), power
        way = better + power / before * way
    return found


def _best_length(slope: float, change: float) -> float:
    """Where a parabola has its minimum that begins with a slope and has changed so much at 1."""
    bend = change - slope
    return min(-slope / (2 * bend), _LONGEST) if bend > 0 else _LONGEST


def bounded_step(normal: Arrow, gradient: Real, added: Real, bounds: tuple[Real, Real]) -> Real:
    """The d that minimises g'd + d'(N + diag(added)) d / 2 between bounds; (n,).

    What would cross a bound is put on it, all at once as long as that lowers the cost, else only
    the first on the way there: the cost never rises, so that no set of bounds comes twice.

    Args:
        normal: N.
        gradient: g; (n,).
        added: to its diagonal; (n,).
        bounds: lower (0 or less) and upper (0 or more) of d; (n,) each.
    """
    lower, upper = bounds

    def cost(d: Real) -> float:
        return float(gradient @ d + 0.5 * d @ (normal.times(d) + added * d))

    held: Mask = ((lower >= 0) & (gradient > 0)) | ((upper <= 0) & (gradient < 0))
    step = np.zeros(len(gradient))
    for _ in range(_ROUNDS):
        fixed = np.where(held, step, 0.0)
        right = -(gradient + normal.times(fixed))
        aim = np.where(held, fixed, normal.solve(right, added, ~held))
        beyond = ~held & ((aim < lower) | (aim > upper))
        if beyond.any():
            clipped = np.clip(aim, lower, upper)
            if cost(clipped) < cost(step):
                step, held = clipped, held | beyond
                continue
            ends = np.where(aim > upper, upper, lower)
            way = np.where(beyond, aim - step, 1.0)
            share = np.where(beyond, (ends - step) / way, np.inf)
            first = share <= share.min()
            step = np.where(first, ends, step + share.min() * (aim - step))
            held = held | first
            continue
        step = aim
        slope = gradient + normal.times(step) + added * step
        inward = held & (((step <= lower) & (slope < 0)) | ((step >= upper) & (slope > 0)))
        if not inward.any():
            break
        held = held & ~inward
    return np.clip(step, lower, upper)


def _ended(state: _State, value: float, outcome: Outcome, advice: str) -> Minimum:
    return Minimum(state.x, value, state.evaluations, outcome, advice)
