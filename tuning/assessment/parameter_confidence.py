r"""How sure tuned parameters are, and what the data cannot tell.

At the minimum the posterior density is nearly normal, with the covariance

    C = (N / s^2 + D)^-1,   s^2 = max(1, sum |r|^2 / var / n),

N the normal equations of the data, D the precision of the priors; s^2 makes data count less where
the model does not reach their noise, since what it lacks moves parameters too. What the drawing
does not know has a standard deviation of log 100 for a prior here, its bound, so that C exists
where data see nothing; what is no logarithm as many of its units, or of its own size if that is
more: an angular momentum of 8000 units is not known to 5 of them by that alone.

A direction v of these coordinates whose deviation is above 1 (a factor of 7 up or down in 95 %)
even with s = 1 is one that the data cannot see. If two stiffnesses make it, then dk1 = -dk2 leaves
their sum, d(1/k1) = -d(1/k2) that of their compliances.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Campaign, Mask, Real
from mbmodel import Model
from tuning.files.schema import CorrelationRow, UnseenRow
from tuning.fitting.fitter import Fit
from tuning.fitting.stages import LAST
from tuning.misfit.normal_equations import Arrow
from tuning.parametrisation.parametrisation import Freedom

QUANTILE = 1.959964  # of 95 %
# Standard deviations: the largest of 300 tolerances is beyond it in one campaign of 500.
PLAUSIBLE = 4.5
WIDEST = float(np.log(100.0))
UNSEEN = 1.0  # standard deviation of a logarithm
_CORRELATED = 0.9
_MEMBER = 0.25  # of the largest entry of a direction
_ALIKE = 0.98  # cosine of a direction with that of a sum


@dataclass(frozen=True, eq=False)
class Confidence:
    """What a fit is worth.

    Args:
        freedom: its coordinates.
        x: where it ended; (n_x,).
        normal: N at x.
        chi_square: sum |r|^2 / var / n of the data.
    """

    freedom: Freedom
    x: Real
    normal: Arrow
    chi_square: float

    @property
    def widened(self) -> float:
        """The s^2 of the covariance."""
        return max(1.0, self.chi_square)

    @cached_property
    def covariance(self) -> Real:
        """C; (n_x, n_x)."""
        return self._posterior(self.widened)

    @cached_property
    def _sight(self) -> Real:
        """C of a model that reaches the noise: what the data could tell; (n_x, n_x)."""
        return self.covariance if self.widened == 1 else self._posterior(1.0)

    def _posterior(self, widened: float) -> Real:
        unit = np.where(self.freedom.is_logarithm, 1.0, np.maximum(np.abs(self.x), 1.0))
        precision = np.where(self.freedom.has_prior, 1.0, (WIDEST * unit) ** -2)
        whole = self.normal.dense() / widened + np.diag(precision)
        scale = 1 / np.sqrt(np.diag(whole))
        covariance: Real = np.linalg.inv(whole * np.outer(scale, scale)) * np.outer(scale, scale)
        return (covariance + covariance.T) / 2

    @cached_property
    def deviation(self) -> Real:
        """Standard deviation of each coordinate; (n_x,)."""
        deviation: Real = np.sqrt(np.diag(self.covariance))
        return deviation

    def interval(self) -> tuple[Real, Real]:
        """Lowest and highest value of each parameter in 95 %, in SI; (n_parameter,) each."""
        spread = QUANTILE * self.deviation
        ends = self.freedom.theta(self.x - spread), self.freedom.theta(self.x + spread)
        return np.minimum(*ends), np.maximum(*ends)

    def parameter_deviation(self) -> Real:
        """Standard deviation of each parameter, of sizes relative; (n_parameter,)."""
        freedom = self.freedom
        own = np.append(self.deviation, 0.0)[freedom.member] * freedom.scale
        deviation: Real = np.where(freedom.free, own, 0.0)
        return deviation

    @cached_property
    def unknown(self) -> Mask:
        """Parameters that the data do not tell: no interval narrower than a factor of 7."""
        freedom = self.freedom
        vague = ~freedom.has_prior & (np.diag(self._sight) > UNSEEN**2)
        return np.append(vague, False)[freedom.member]

    def correlations(self) -> tuple[CorrelationRow, ...]:
        """Pairs with a correlation above 0.9, strongest first."""
        unit = self.covariance / np.outer(self.deviation, self.deviation)
        first, second = np.nonzero(np.triu(np.abs(unit) > _CORRELATED, 1))
        names = self.freedom.names
        found = [
            CorrelationRow(first=names[a], second=names[b], correlation=float(unit[a, b]))
            for a, b in zip(first, second, strict=True)
        ]
        return tuple(sorted(found, key=lambda one: -abs(one.correlation)))

    def unseen(self) -> tuple[UnseenRow, ...]:
        """Directions that the data cannot see, the vaguest first."""
        return tuple(self._directions())

    def _directions(self) -> Iterator[UnseenRow]:
        freedom = self.freedom
        places = np.flatnonzero(~freedom.has_prior)
        if not places.size:
            return
        values, vectors = np.linalg.eigh(self._sight[np.ix_(places, places)])
        theta = freedom.theta(self.x)
        first = {int(k): int(np.flatnonzero(freedom.member == k)[0]) for k in places}
        for value, vector in sorted(zip(values, vectors.T, strict=True), key=lambda one: -one[0]):
            if value <= UNSEEN**2:
                break
            members = np.flatnonzero(np.abs(vector) > _MEMBER * np.abs(vector).max())
            members = members[np.argsort(-np.abs(vector[members]), kind="stable")]
            names = tuple(freedom.names[places[k]] for k in members)
            sizes = np.array([theta[first[int(places[k])]] for k in members])
            sentence = _in_words(names, vector[members], sizes)
            deviation = float(np.sqrt(value))
            yield UnseenRow(parameters=list(names), deviation=deviation, sentence=sentence)


def confidence(model: Model, campaign: Campaign, found: Fit, jobs: int = 1) -> Confidence:
    """Linearise once more where a fit ended, on all lines, at the weights of the noise.

    Args:
        model: that was fitted.
        campaign: likewise.
        found: the fit.
        jobs: threads; the result does not depend on it.
    """
    problem = (found.last or LAST).misfit(model, campaign, found.freedom, threads=jobs)
    value, _, normal = problem.normal(found.x)
    data = value - problem.prior(found.x)
    return Confidence(found.freedom, found.x, normal, data / max(problem.values, 1))


def pulls(freedom: Freedom, x: Real) -> list[tuple[str, float]]:
    """Tolerances by how many standard deviations they were pulled, most first."""
    order = np.argsort(-np.abs(np.where(freedom.has_prior, x, 0.0)), kind="stable")
    return [(freedom.names[k], float(x[k])) for k in order if freedom.has_prior[k]]


def _in_words(names: tuple[str, ...], vector: Real, sizes: Real) -> str:
    """What a direction of logarithms means."""
    if len(names) == 1:
        return f"{names[0]} is not seen by the data"
    if len(names) > 2:
        return f"{', '.join(names[:-1])} and {names[-1]} are seen in combination only"
    both = f"{names[0]} and {names[1]} are seen only as"
    for way, what in ((-1, "a sum"), (1, "a sum of compliances")):
        alone = np.array([1.0, -1.0]) * sizes**way
        cosine = abs(float(alone @ vector)) / np.linalg.norm(alone) / np.linalg.norm(vector)
        if cosine > _ALIKE:
            return f"{both} {what}"
    return f"{both} a product" if vector[0] * vector[1] < 0 else f"{both} a ratio"
