r"""What it costs to hold tolerances within their bounds, in many draws at once.

A fit without bounds has the tolerances x. With its covariance C, tolerance j that is held at its
bound, v from x_j, raises the cost by v^2 / C_jj, moves the others by -C_ij v / C_jj, and C loses
its column: a pivoted Cholesky factor of C. The one that costs most is held first, until none is
beyond its bound. That is bounded least squares if none of them would leave its bound again.
"""

import numpy as np

from truth.campaign.bounded_least_squares import BOUND
from truth.machine.station import Integer, Real

_MAX_HELD = 24  # tolerances at their bounds
_SMALLEST_VARIANCE = 1e-12  # of a tolerance, in units of its prior's


def hold_tolerances(shift: Real, covariance: Real) -> tuple[Real, Integer]:
    """Return what it costs to hold tolerances within their bounds.

    Args:
        shift: x of a fit without bounds; (n_draw, n_tolerance).
        covariance: C; (n_tolerance, n_tolerance).

    Returns:
        Rise of the cost, and the tolerance that costs most, -1 if none is beyond its bound;
        (n_draw,).
    """
    draws, shift = np.arange(len(shift)), shift.copy()
    variance = np.tile(np.diag(covariance), (len(shift), 1))
    columns: list[Real] = []
    total, farthest = np.zeros(len(shift)), np.full(len(shift), -1)
    for _ in range(_MAX_HELD):
        beyond = np.sign(shift) * np.maximum(np.abs(shift) - BOUND, 0.0)
        costs = np.where(variance > _SMALLEST_VARIANCE, beyond**2, 0.0) / variance
        worst = costs.argmax(axis=1)
        cost, excess = costs[draws, worst], beyond[draws, worst]
        if not columns:
            farthest = np.where(cost > 0, worst, -1)
        if not cost.any():
            break
        total = total + cost
        column = covariance[worst]
        for held in columns:
            column = column - held * held[draws, worst][:, None]
        pivot = np.where(cost > 0, variance[draws, worst], np.inf)[:, None]
        shift = shift - column * excess[:, None] / pivot
        columns.append(column / np.sqrt(pivot))
        variance = np.maximum(variance - columns[-1] ** 2, _SMALLEST_VARIANCE)
    return total, farthest
