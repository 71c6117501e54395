r"""How a diagnosis weighs fits: odds of a cause, and when tolerances explain the data by chance.

A fit without a cause leaves the gap e_0 per value, one with a cause e_1. With N independent values
of its residual, M effects and places, and the share s = 1 / (1 + e_1) <= s_max of the noise,

    l = N [ln(1 + e_0) - ln(1 + e_1)] - k / 2 - ln M,   1 / N = s^q / n + (1 - s^q) / n_e

are the log odds of a cause with k parameters against "unexplained" (design effect: Kish 1965, ch.
5.4; parameters: Wilks 1938). Those of "none" are ln(hidden / e_0) / width.

Among m tolerances the k farthest are chance if they are not less probable together than one
outlier: P(k or more of m beyond the k-th) >= P(one or more of m beyond the outlier), binomial.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom, chi2, norm

from truth.campaign.bounded_least_squares import BOUND
from truth.machine.station import Integer, Mask, Real

_THRESHOLD_HALVINGS = 40  # of the interval of a threshold
_SMALLEST_GAP = 1e-9


@dataclass(frozen=True)
class Weighing:
    """How a diagnosis weighs fits.

    Args:
        values: number of complex values of the test.
        fitted_values: number of those that a fit sees.
        counted_values: number of those that the posterior counts.
        error_values: number of independent values of a model's error.
        noise_exponent: q, how nearly a residual must be noise alone to be independent.
        max_noise_share: s_max, the largest share of the noise in the variance of a fit.
        hidden: gap per value that badly known noise may hide.
        hidden_width: width of its logarithm.
        min_closed: part of the gap that a material cause closes.
        outlier: standard deviations up to which a tolerance is no effect.
    """

    values: float
    fitted_values: float
    counted_values: float
    error_values: float
    noise_exponent: float
    max_noise_share: float
    hidden: float
    hidden_width: float
    min_closed: float
    outlier: float

    def weigh(self, before: Real, after: Real, hypotheses: int, parameters: Integer) -> Real:
        """Return l of fits [nats]; (n_draw, n_fit).

        Args:
            before: e_0; (n_draw,).
            after: e_1, of the effect itself first; (n_draw, n_fit).
            hypotheses: number M of effects and places.
            parameters: number k of parameters of each fit; (n_fit,).
        """
        share = np.minimum(1 / (1 + after[:, :1]), self.max_noise_share) ** self.noise_exponent
        count = 1 / (share / self.counted_values + (1 - share) / self.error_values)
        gained = np.log1p(before)[:, None] - np.log1p(after)
        logs: Real = count * gained - parameters / 2 - np.log(hypotheses)
        return logs

    def weigh_nothing(self, gap: Real) -> Real:
        """Return the log odds of "none" at a gap per value; (n_draw,)."""
        logs: Real = np.log(self.hidden / np.maximum(gap, _SMALLEST_GAP)) / self.hidden_width
        return logs

    def limits_of_chance(self, count: int) -> Real:
        """Return the shifts up to which the farthest of some tolerances are chance; (n_limit,).

        The first is that of the farthest, the outlier; those within the bound are left out.
        """
        least = binom.sf(0, count, self._outlier_tail)
        low, high = np.full(count, BOUND), np.full(count, self.outlier)
        for _ in range(_THRESHOLD_HALVINGS):
            middle = (low + high) / 2
            is_chance = binom.sf(np.arange(count), count, 2 * norm.sf(middle)) >= least
            low, high = np.where(is_chance, middle, low), np.where(is_chance, high, middle)
        return low[low > BOUND]

    def is_outlier(self, squares: Real, count: int) -> Mask:
        """Return whether shifts of some tolerances together are no less probable than an outlier.

        Args:
            squares: sum of their squares, chi square; (n_draw,).
            count: number of tolerances.
        """
        small: Mask = chi2.sf(squares, count) >= self._outlier_tail
        return small

    @property
    def _outlier_tail(self) -> float:
        return float(2 * norm.sf(self.outlier))
