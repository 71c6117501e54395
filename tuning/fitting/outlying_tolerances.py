"""Tolerances that lie beyond their bounds by chance.

Among hundreds of tolerances some exceed their bounds of 2.5 standard deviations by chance. Held at
the bound, such a tolerance leaves a gap that looks like an effect, or like an error of the model
beside one. So those at a bound are fitted up to 4.5 standard deviations, however many they are: one
outlier that is held drives others to their bounds, and these come back once it is free. One that
ends there too is a fault, which no tolerance may hide. So are several that are improbable together:
of n tolerances, the binomial probability that k shift as far as the k-th largest must not be below
that of one beyond 4.5.
"""

import numpy as np
from scipy.special import betainc, ndtr

from identification.words import TOLERANCE_BOUND_SIGMA, Real
from tuning.parametrisation.parametrisation import Parametrisation

# Largest plausible pull of a tolerance [standard deviations]: in one campaign of 500 the largest of
# 300 tolerances exceeds it by chance.
PLAUSIBLE_PULL_SIGMA = 4.5


def widen_outliers(
    varies: Parametrisation, x: Real, sigma: float = PLAUSIBLE_PULL_SIGMA
) -> Parametrisation | None:
    """Return coordinates in which tolerances at their bounds may shift further; None without any.

    Args:
        varies: coordinates of a fit.
        x: their values at its end; (n_x,).
        sigma: wider bound [standard deviations].
    """
    wide = varies.widen_bounds(varies.coordinates_at_bound(x), sigma)
    has_wider = (wide.lower < varies.lower) | (wide.upper > varies.upper)
    return wide if has_wider.any() else None


def admit_shifts(narrow: Parametrisation, x: Real) -> Parametrisation:
    """Return coordinates in which tolerances that lie beyond their bounds have wider ones.

    Args:
        narrow: coordinates with the usual bounds.
        x: their values at the end of a fit that admitted outliers; (n_x,).
    """
    return narrow.widen_bounds(~narrow.coordinates_within_bounds(x), PLAUSIBLE_PULL_SIGMA)


def are_by_chance(
    narrow: Parametrisation,
    wide: Parametrisation,
    x: Real,
    sigma: float = PLAUSIBLE_PULL_SIGMA,
) -> bool:
    """Return whether tolerances shift beyond their bounds by chance.

    Args:
        narrow: coordinates with the usual bounds.
        wide: coordinates in which outliers may shift further.
        x: their values at the end of a fit; (n_x,).
        sigma: wider bound [standard deviations].
    """
    has_wider = (wide.lower < narrow.lower) | (wide.upper > narrow.upper)
    if (wide.coordinates_at_bound(x) & has_wider).any():
        return False
    shifts = -np.sort(-np.abs(x[wide.is_tolerance]))
    beyond = shifts[shifts >= TOLERANCE_BOUND_SIGMA]
    # Probability of more than k among n shifts, I_p(k + 1, n - k), for k = 0, 1, ...
    count, more = len(shifts), np.arange(len(beyond))
    by_chance = betainc(more + 1, count - more, 2 * ndtr(-beyond))
    return not (by_chance < betainc(1, count, 2 * ndtr(-sigma))).any()
