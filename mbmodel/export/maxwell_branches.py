"""A law as a sum of Maxwell branches, each a spring and a damper in series, beside a spring."""

import numpy as np
import scipy.optimize

from identification.words import Complex, Real
from mbmodel.export.rational_function import RationalFunction

_OUTER_CORNERS = 4.0  # corner frequencies reach beyond the band by this factor


def fit_maxwell_branches(
    laplace: Complex, values: Complex, weights: Real, branches: int, lowest_constant: float
) -> RationalFunction:
    """Fit a law by a spring, and Maxwell branches and a damper of positive size.

    The spring may be negative, down to a bound. Non-negative least squares (Lawson and Hanson
    1974): without a bound it is the difference of two springs, with one it counts from there.

    Args:
        laplace: s = i w, rising [rad/s]; (n_freq,).
        values: of the law; (n_freq,).
        weights: of the lines; (n_freq,).
        branches: number of corner frequencies, at even steps of their logarithm.
        lowest_constant: lower bound of the law at s = 0; -inf for none.
    """
    omega = laplace.imag
    corners = np.geomspace(omega[0] / _OUTER_CORNERS, omega[-1] * _OUTER_CORNERS, branches)
    is_bounded = np.isfinite(lowest_constant)
    start = lowest_constant if is_bounded else 0.0
    columns = np.stack(
        [
            np.ones_like(laplace),
            np.zeros_like(laplace) if is_bounded else -np.ones_like(laplace),
            laplace / omega[-1],
            *(laplace / (laplace + corner) for corner in corners),
        ],
        axis=1,
    )
    target = np.concatenate([values.real - start, values.imag])
    rows = np.tile(weights / weights.max(), 2)
    matrix = np.vstack([columns.real, columns.imag])
    sizes, _ = scipy.optimize.nnls(rows[:, None] * matrix, rows * target)
    used = sizes[3:] > 0
    sum_of_branches = float(sizes[3:].sum())
    return RationalFunction(
        -corners[used] + 0j,
        -(sizes[3:] * corners)[used] + 0j,
        start + float(sizes[0] - sizes[1]) + sum_of_branches,
        float(sizes[2] / omega[-1]),
    )
