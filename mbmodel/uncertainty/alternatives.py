"""Alternative plants: a cause whose probability is below one is there, or it is not.

The density of a magnitude is a mixture of normal ones, one for each alternative,

    P(|H| <= m) = sum_i w_i Phi((m - |H_i|) / s_i),

with the probability w_i of the alternative, its FRF H_i and its standard deviation s_i: below |H_i|
that of the magnitude, above it that which gives the upper end of its own interval. The 2.5 and
97.5 % quantiles are the ends of the interval, found by bisection.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from identification.words import Real, UsageError
from mbmodel.uncertainty.frf_bands import NORMAL_QUANTILE_95, FrfBands

_LOW_PROBABILITY, _HIGH_PROBABILITY = 0.025, 0.975
_WIDEST_SIGMA = 10.0  # beyond which no density is left
_BISECTIONS = 60  # each halves the interval: to the rounding of a double


@dataclass(frozen=True, eq=False)
class AlternativePlants:
    """Plants of which one is true.

    Args:
        names: of the alternatives; n.
        weights: probability of each, of sum one; (n,).
        bands: FRFs of each with their deviations, of one request; n.
    """

    names: tuple[str, ...]
    weights: Real
    bands: tuple[FrfBands, ...]

    def __post_init__(self) -> None:
        """Check that the weights are probabilities."""
        if len(self.weights) != len(self.bands) or not np.isclose(self.weights.sum(), 1):
            raise UsageError("the weights of alternative plants must be probabilities of sum one")

    def magnitude_interval(self) -> tuple[Real, Real]:
        """Return both ends of the 95 % interval of |H|; (n_freq, n_out, n_in) each."""
        sizes = np.array([np.abs(band.values) for band in self.bands])
        below = np.array([band.magnitude_deviation for band in self.bands])
        upper = np.array([band.magnitude_interval()[1] for band in self.bands])
        above = (upper - sizes) / NORMAL_QUANTILE_95
        return (
            self._quantile(sizes, below, above, _LOW_PROBABILITY),
            self._quantile(sizes, below, above, _HIGH_PROBABILITY),
        )

    def _quantile(self, sizes: Real, below: Real, above: Real, probability: float) -> Real:
        """Return a quantile of the mixture, at least zero."""
        low = (sizes - _WIDEST_SIGMA * below).min(axis=0)
        high = (sizes + _WIDEST_SIGMA * above).max(axis=0)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            units = np.maximum(np.where(middle < sizes, below, above), np.finfo(float).tiny)
            with np.errstate(over="ignore"):
                share = np.tensordot(self.weights, ndtr((middle - sizes) / units), 1)
            low = np.where(share < probability, middle, low)
            high = np.where(share < probability, high, middle)
        quantile: Real = np.maximum((low + high) / 2, 0.0)
        return quantile
