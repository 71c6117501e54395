"""The bottom of a quadratic model within bounds, by an active-set method.

A coordinate that would cross a bound is put on it, and one that the slope drives inwards is
released (Nocedal and Wright 2006, ch. 16.5).
"""

import numpy as np

from identification.words import Mask, Real
from tuning.misfit.normal_equations import ArrowMatrix, ArrowSolver

_MAX_ACTIVE_SET_ITERATIONS = 200


def bounded_step(
    normal: ArrowMatrix, gradient: Real, added: Real, bounds: tuple[Real, Real]
) -> Real:
    """Return the d that minimises g'd + d'(N + diag(added)) d / 2 within bounds; (n,).

    Active-set method. All coordinates that would cross a bound are put on it together if this
    lowers the cost; otherwise only the first one on the way is. The cost never rises, so that no
    active set occurs twice.

    Args:
        normal: N.
        gradient: g; (n,).
        added: added to the diagonal of N; (n,).
        bounds: lower (at most 0) and upper (at least 0) bounds of d; (n,) each.
    """
    lower, upper = bounds

    def cost(d: Real) -> float:
        return float(gradient @ d + 0.5 * d @ (normal.multiply(d) + added * d))

    is_active: Mask = ((lower >= 0) & (gradient > 0)) | ((upper <= 0) & (gradient < 0))
    step, solver = np.zeros(len(gradient)), ArrowSolver(normal, added)
    for _ in range(_MAX_ACTIVE_SET_ITERATIONS):
        fixed = np.where(is_active, step, 0.0)
        right = -(gradient + normal.multiply(fixed))
        target = np.where(is_active, fixed, solver.solve(right, ~is_active))
        is_outside = ~is_active & ((target < lower) | (target > upper))
        if is_outside.any():
            clipped = np.clip(target, lower, upper)
            if cost(clipped) < cost(step):
                step, is_active = clipped, is_active | is_outside
                continue
            bounds_hit = np.where(target > upper, upper, lower)
            direction = np.where(is_outside, target - step, 1.0)
            share = np.where(is_outside, (bounds_hit - step) / direction, np.inf)
            first = share <= share.min()
            step = np.where(first, bounds_hit, step + share.min() * (target - step))
            is_active = is_active | first
            continue
        step = target
        slope = gradient + normal.multiply(step) + added * step
        inward = is_active & (((step <= lower) & (slope < 0)) | ((step >= upper) & (slope > 0)))
        if not inward.any():
            break
        is_active = is_active & ~inward
    return np.clip(step, lower, upper)
