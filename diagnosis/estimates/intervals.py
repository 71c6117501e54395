"""Parameters of a refit with their intervals, as the verdict states them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Ends, Hypothesis, Vague, Value
from diagnosis.refits.refit import Refit, map_values
from identification.words import Real
from tuning import (
    STAGES,
    ParameterConfidence,
    Parametrisation,
    estimate_confidence,
    fit,
    thin_lines,
)
from tuning.assessment.parameter_confidence import NORMAL_QUANTILE_95, PLAUSIBLE_PULL_SIGMA

_SLOPE_OFFSET_SIGMA, _SLOPE_STEP_SIGMA = (
    1e-5,
    1e-7,
)  # standard deviations: where slopes are taken, and over what
_MIN_SINGULAR_SHARE = 1e-6  # of a slope, what is none
_EXACT_NOISE_SHARE = 0.95  # of the variance: little but noise remains
# Of 100000 values 0.03 nats: a quarter of a standard deviation.
FINAL_STAGE = replace(STAGES[5], tolerance=3e-7, max_steps=60, exact_curvature=True)
_RANDOM_DIRECTIONS = 100  # points of the ellipsoid, and as many across


@dataclass(frozen=True, eq=False)
class FittedParameters:
    """Parameters of a refit with their confidence.

    Args:
        parametrisation: its coordinates.
        theta: the parameters; (n_parameter,).
        confidence: their confidence.
        converged: whether the fit that they come from went to its end.
    """

    parametrisation: Parametrisation
    theta: Real
    confidence: ParameterConfidence
    converged: bool = True

    def state_parameters(self, hypothesis: Hypothesis) -> dict[str, Value]:
        """Return the parameters of a hypothesis as the verdict states them."""
        return hypothesis.state(map_values(self.parametrisation, self.theta))

    def estimate_intervals(self, hypothesis: Hypothesis) -> dict[str, Ends]:
        """Of a hypothesis' parameters, 95 %; none of those that were not fitted.

        With C the covariance of the coordinates x, an interval is from the least to the most that a
        stated number y comes to on the ellipsoid d' C^-1 d = q^2 about x. With g its slope, that is
        at d = +- q C g / sqrt(g' C g): y +- q sqrt(g' C g) of what is linear in x, of the
        exponential of a coordinate the ends of its logarithm. Further points, strewn at random,
        are for what bends, as the largest of several does: of what is linear they are within.
        Of each d counts P d, without what changes nothing that is stated, of which the data may
        know nothing: four supports that lose alike, which is a softer joint. What shapes an effect
        (logarithms of frequencies, of time constants) ends where fits may reach: of a damping that
        the data do not tell the ends were 1e-38 and 1e40 N s/m.

        None is said of what goes with a size that may as well be nothing, such as the place of a
        mass: a quotient has bounds only where its divisor is not zero (Fieller 1954).
        """
        read = _Read(map_values(self.parametrisation, self.theta))
        middle = hypothesis.state(read)
        stating = [k for k, name in enumerate(self.parametrisation.names) if name in read.names]
        if not stating or not middle:
            return {}
        deviation = self.confidence.deviation[stating]
        correlation = self.confidence.covariance[np.ix_(stating, stating)] / np.outer(
            deviation, deviation
        )
        sizes = hypothesis.scored or self.parametrisation.names
        shapes = [k for k in stating if self.parametrisation.names[k] not in sizes]
        ends = self.parametrisation.lower[shapes], self.parametrisation.upper[shapes]

        def at(units: Real) -> Real:
            x = self.confidence.x.copy()
            x[stating] += deviation * units
            x[shapes] = np.clip(x[shapes], *ends)
            values = middle | hypothesis.state(
                map_values(self.parametrisation, self.parametrisation.theta(x))
            )
            return _flatten({name: values[name] for name in middle})

        slopes = _slopes(at, self._inwards(stating))
        kept = _row_space(slopes)
        root = _root(kept @ correlation @ kept)
        ways = np.vstack([slopes @ root, _random_directions(len(stating))])
        ways = ways[ways.any(axis=1)]
        farthest = NORMAL_QUANTILE_95 * ways / np.linalg.norm(ways, axis=1)[:, None] @ root
        points = [_flatten(middle), *(at(sign * point) for point in farthest for sign in (-1, 1))]
        return _drop_undetermined(
            _pair_ends(middle, np.min(points, axis=0), np.max(points, axis=0))
        )

    def _inwards(self, stating: list[int]) -> Real:
        """Where no two are equal, a little inside of bounds: 1e-5 of a deviation away."""
        x = self.confidence.x[stating]
        above = self.parametrisation.upper[stating] - x < x - self.parametrisation.lower[stating]
        away = _SLOPE_OFFSET_SIGMA * np.arange(1, len(stating) + 1) / len(stating)
        return np.where(above, -away, away)


def _slopes(at: Callable[[Real], Real], units: Real) -> Real:
    """Central differences of all stated numbers by each coordinate; (n_number, n_coordinate)."""
    steps = _SLOPE_STEP_SIGMA * np.eye(len(units))
    return np.array(
        [(at(units + step) - at(units - step)) / (2 * _SLOPE_STEP_SIGMA) for step in steps]
    ).T


def _row_space(slopes: Real) -> Real:
    """P: what of a change of the coordinates changes anything that is stated, to first order."""
    sizes = np.linalg.norm(slopes, axis=1)
    _, values, ways = np.linalg.svd(slopes[sizes > 0] / sizes[sizes > 0, None])
    felt = ways[: len(values)][values > _MIN_SINGULAR_SHARE]
    projector: Real = felt.T @ felt
    return projector


def _root(matrix: Real) -> Real:
    """The symmetric root of a positive semidefinite matrix."""
    values, ways = np.linalg.eigh(matrix)
    root: Real = ways * np.sqrt(np.maximum(values, 0.0)) @ ways.T
    return root


def _random_directions(count: int) -> Real:
    """Directions at random, always the same; (n, count)."""
    return np.random.default_rng(0).standard_normal((_RANDOM_DIRECTIONS, count))


def _drop_undetermined(intervals: dict[str, Ends]) -> dict[str, Ends]:
    """Without what goes with a size that may be nothing."""
    rows = {name: np.array(ends) for name, ends in intervals.items()}
    doubtful = {name for name, row in rows.items() if row.ndim == 1 and row[0] < 0 < row[1]}
    return {name: ends for name, ends in intervals.items() if not doubtful or name in doubtful}


class _Read(dict[str, float]):
    """Parameters by name, that knows which of them were asked for."""

    def __init__(self, values: Mapping[str, float]) -> None:
        super().__init__(values)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> float:
        """A value."""
        self.names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: float = 0.0) -> float:  # type: ignore[override]
        """A value, or the default."""
        self.names.add(name)
        return super().get(name, default)


def fit_parameters(refit: Refit, pace: int = 1) -> FittedParameters:
    """Return the parameters of a refit with their confidence.

    Where little but noise remains, the fit goes to its end on all lines, with tolerances unbounded
    unless their bounds hide a fault: of 300 tolerances some exceed the 2.5 standard deviations with
    which the gap is stated, and push the parameters by several of their own. Otherwise the residual
    is shared among values, and the covariance is that of the independent ones.

    Args:
        refit: the refit.
        pace: of its lines only every so manyth counts.
    """
    session, fitted = refit.session, refit.fit
    model, campaign, parametrisation = session.model, session.campaign, fitted.parametrisation
    if refit.statistics.noise_share > _EXACT_NOISE_SHARE:
        stage = replace(FINAL_STAGE, model_error_floor=refit.floor, stride=pace)
        for coordinates in (parametrisation.lift_bounds(), parametrisation):
            fitted = fit(
                model,
                campaign,
                parametrisation=coordinates,
                starts=(refit.fit.theta,),
                stages=(stage,),
            )
            if fitted.outcome == "interrupted":
                raise KeyboardInterrupt
            shifts = np.abs(fitted.x[coordinates.has_prior])
            if shifts.max(initial=0.0) <= PLAUSIBLE_PULL_SIGMA:
                break
        confidence = estimate_confidence(model, thin_lines(campaign, pace), fitted)
    else:
        confidence = estimate_confidence(model, thin_lines(campaign, 4 * pace), fitted)
        shared = refit.statistics.values / refit.statistics.effective_values
        confidence = replace(confidence, chi_square=max(confidence.chi_square, shared))
    return FittedParameters(fitted.parametrisation, fitted.theta, confidence, fitted.converged)


def _flatten(stated: Mapping[str, Value]) -> Real:
    """All numbers in a row."""
    return np.concatenate([np.ravel(value) for value in stated.values()] or [np.zeros(0)])


def _pair_ends(stated: Mapping[str, Value], low: Real, high: Real) -> dict[str, Ends]:
    """Low and high of each number, of a vector those of each component."""
    intervals: dict[str, Ends] = {}
    place = 0
    for name, value in stated.items():
        size = int(np.size(value))
        span = slice(place, place + size)
        pairs = tuple(zip(low[span].tolist(), high[span].tolist(), strict=True))
        if (high[span] > low[span]).any() and not isinstance(value, Vague):
            intervals[name] = pairs if isinstance(value, tuple) else pairs[0]
        place += size
    return intervals
