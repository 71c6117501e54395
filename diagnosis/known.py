"""What is known of a refit's parameters: their intervals, as the verdict states them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Ends, Hypothesis, Value
from diagnosis.refit import FINAL, Refit, named, uninterrupted
from identification.words import Real
from tuning import PLAUSIBLE, QUANTILE, Confidence, Freedom, confidence, fit, thinned


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of a refit's parameters.

    Args:
        freedom: its coordinates.
        theta: the parameters; (n_parameter,).
        sure: their confidence.
    """

    freedom: Freedom
    theta: Real
    sure: Confidence

    def stated(self, one: Hypothesis) -> dict[str, Value]:
        """What the verdict states of a hypothesis."""
        return one.state(named(self.freedom, self.theta))

    def intervals(self, one: Hypothesis) -> dict[str, Ends]:
        """Of a hypothesis' parameters, 95 %; none of those that were not fitted.

        With C the covariance of the coordinates x and g the slope of a stated number y, its ends
        are y(x +- q C g / sqrt(g' C g)): of y linear in x those are y +- q sqrt(g' C g), of the
        exponential of a coordinate those of its logarithm.
        """
        varies, sure, x = self.freedom, self.sure, self.sure.x
        middle = self.stated(one)
        flat = _flat(middle)
        read = _Read(named(varies, self.theta))
        one.state(read)
        own = [k for k, name in enumerate(varies.names) if name in read.names]
        covariance = sure.covariance[np.ix_(own, own)]

        def moved(by: Real) -> Real:
            change = np.zeros(len(x))
            change[own] = by
            stated = middle | one.state(named(varies, varies.theta(x + change)))
            return _flat({name: stated[name] for name in middle})

        slopes = np.zeros((len(flat), len(own)))
        for place, step in enumerate(0.1 * sure.deviation[own]):
            slopes[:, place] = (moved(step * (np.arange(len(own)) == place)) - flat) / step
        ends = np.tile(flat, (3, 1))
        for place, slope in enumerate(slopes):
            spread = np.sqrt(slope @ covariance @ slope)
            if spread > 0:
                farthest = QUANTILE * (covariance @ slope) / spread
                ends[1:, place] = moved(-farthest)[place], moved(farthest)[place]
        return _paired(middle, ends.min(axis=0), ends.max(axis=0))


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


def known(found: Refit, theta: Real, stride: int, jobs: int = 1) -> Known:
    """Parameters and their confidence, tolerances without bounds unless these hide a fault.

    Of 300 tolerances some are beyond 2.5 standard deviations: their bounds, which the gap is
    stated with, push what was found by up to five of its own.

    Args:
        found: the refit.
        theta: where to begin, within the bounds; (n_parameter,).
        stride: every so manyth line counts.
        jobs: threads.
    """
    model, campaign, varies = found.session.model, found.session.campaign, found.fit.freedom
    stage = replace(FINAL, stride=stride)
    for own in (varies.unbounded(), varies):
        best = uninterrupted(
            fit(model, campaign, varies=own, starts=(theta,), stages=(stage,), jobs=jobs)
        )
        if np.abs(best.x[own.has_prior]).max(initial=0.0) <= PLAUSIBLE:
            break
    sure = confidence(model, thinned(campaign, stride), best, jobs)
    return Known(best.freedom, best.theta, sure)


def _flat(stated: Mapping[str, Value]) -> Real:
    """All numbers in a row."""
    return np.concatenate([np.ravel(value) for value in stated.values()] or [np.zeros(0)])


def _paired(stated: Mapping[str, Value], low: Real, high: Real) -> dict[str, Ends]:
    """Low and high of each number, of a vector those of each component."""
    found: dict[str, Ends] = {}
    place = 0
    for name, value in stated.items():
        size = int(np.size(value))
        span = slice(place, place + size)
        pairs = tuple(zip(low[span].tolist(), high[span].tolist(), strict=True))
        if (high[span] > low[span]).any():
            found[name] = pairs if isinstance(value, tuple) else pairs[0]
        place += size
    return found
