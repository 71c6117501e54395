"""Normal equations of a refit, and their solution with tolerances within their bound."""

import numpy as np
import scipy.linalg
from scipy.linalg import blas

from truth.machine.station import Mask, Real

BOUND = 2.5  # standard deviations within which a tolerance is kept
_MAX_ROUNDS = 30  # changes of the active set
_RELATIVE_RIDGE = 1e-13  # of the diagonal: for a joint that no sensor sees


def normal_matrix(shared: Real, own: Real, shape: tuple[int, ...]) -> Real:
    """Return J^T J of all parameters; a sensor's columns meet the shared ones, no other sensor's.

    Args:
        shared: J of all parameters but the sensors', real parts above imaginary; (2 n_value, n).
        own: J of each sensor on its three rows alone; (n_sensor, 2 n_own, n_each).
        shape: of the FRFs, (n_line, n_out, n_in).
    """
    split, each = shared.shape[1], own.shape[2]
    normal = np.zeros((split + len(own) * each,) * 2)
    half = blas.dsyrk(1.0, shared, trans=1, lower=False)  # in Fortran's order: no copy
    normal[:split, :split] = np.triu(half) + np.triu(half, 1).T
    whole = shared.reshape(2, *shape, split)
    for number, columns in enumerate(own):
        rows = slice(3 * number, 3 * number + 3)
        here = slice(split + each * number, split + each * (number + 1))
        normal[here, here] = columns.T @ columns
        crossed = whole[:, :, rows].reshape(-1, split).T @ columns
        normal[:split, here], normal[here, :split] = crossed, crossed.T
    return normal


def bounded_solution(normal: Real, right: Real, bounded: Mask) -> Real:
    """Return the x that minimises x^T N x / 2 - b^T x with tolerances within their bound.

    An active set holds the tolerances that lie at their bound (bounded least squares).

    Args:
        normal: N, positive definite; (n, n).
        right: b; (n,).
        bounded: which coordinates are tolerances, in standard deviations; (n,).
    """
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0  # a spring or damper of 0 stays 0
    held = np.zeros(len(right))
    for _ in range(_MAX_ROUNDS):
        free = held == 0
        solution = BOUND * held
        inner = normal[np.ix_(free, free)] / np.outer(scale[free], scale[free])
        inner[np.diag_indices_from(inner)] += _RELATIVE_RIDGE
        push = (right[free] - normal[np.ix_(free, ~free)] @ solution[~free]) / scale[free]
        factor = scipy.linalg.cho_factor(inner)
        solution[free] = np.asarray(scipy.linalg.cho_solve(factor, push), np.float64) / scale[free]
        beyond = bounded & free & (np.abs(solution) > BOUND)
        slope = normal @ solution - right
        inward = ~free & (slope * held > 0)  # the cost falls where the bound is left
        if not beyond.any() and not inward.any():
            break
        held[beyond] = np.sign(solution[beyond])
        held[inward] = 0
    limit = np.where(bounded, BOUND, np.inf)
    return np.minimum(np.maximum(solution, -limit), limit)
