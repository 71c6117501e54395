r"""Coordinates of a linear fit within their bounds, from those without bounds.

The coordinates y = (x, h) of the null model and of a hypothesis have the covariance

    D = (C  0)  +  R R'.
        (0  0)

Those that would cross a bound b are held there, and the others follow: y -> y - D_K l, with
l = D_KK^-1 (y_K - b_K), which adds (y_K - b_K)' l / 2 to the cost. That is bounded least squares
if l pushes every held coordinate outwards, and no other one crosses a bound.
"""

import numpy as np

from diagnosis.settings import NEGLIGIBLE_SHARE
from identification.words import Real


def clip_to_bounds(
    start: Real, covariance: tuple[Real, Real], lower: Real, upper: Real
) -> tuple[Real, float]:
    """Return coordinates within bounds, and what that adds to the cost [nats].

    Block principal pivoting: all that violate the conditions of optimality change at once between
    free and held while they become fewer, else one at a time (Portugal, Judice and Vicente 1994).

    Args:
        start: y without bounds; (n,).
        covariance: C and R; (n_x, n_x) and (n, n_root).
        lower: lower bounds; (n,).
        upper: upper bounds; (n,).
    """
    of_null, root = covariance
    side, inside, rise, count = np.zeros(len(start)), start, 0.0, len(of_null)
    fewest = len(start) + 1
    for _ in range(2 * len(start)):
        held = np.flatnonzero(side)
        excess = start[held] - np.where(side > 0, upper, lower)[held]
        columns = root @ root[held].T
        columns[:count, held < count] += of_null[:, held[held < count]]
        push = np.linalg.solve(columns[held], excess)
        inside, rise = start - columns @ push, float(excess @ push) / 2
        inside[held] = start[held] - excess
        changed = (inside < lower - NEGLIGIBLE_SHARE) | (inside > upper + NEGLIGIBLE_SHARE)
        changed[held] = push * side[held] < 0
        if not changed.any():
            break
        if changed.sum() >= fewest:
            changed &= np.cumsum(changed) == 1
        else:
            fewest = int(changed.sum())
        crossed = np.where(inside > upper, 1.0, -1.0) * (side == 0)
        side = np.where(changed, crossed, side)
    return inside, rise
