"""Normal equations of a refit, and their solution with tolerances within their bound."""

import numpy as np
import scipy.linalg
from scipy.linalg import blas

from truth.campaign.frf_sensitivities import Jacobian
from truth.machine.station import Mask, Real

BOUND = 2.5  # standard deviations within which a tolerance is kept
_BLOCK_ROUNDS = 3  # changes of whole blocks that need not leave fewer violations than ever
_SLOPE_ROUNDING = 1e-13  # of the terms of a slope
_RELATIVE_RIDGE = 1e-13  # of the diagonal: for a joint that no sensor sees


def normal_matrix(slopes: Jacobian, shape: tuple[int, ...], before: Real | None = None) -> Real:
    """Return J^T J of all parameters: springs, tolerances, and then each sensor's own.

    A sensor's columns meet those of springs and tolerances, no other sensor's.

    Args:
        slopes: J.
        shape: of the FRFs, (n_line, n_out, n_in).
        before: the matrix of equal slopes by all tolerances, whose part stays; None to form it.
    """
    first = slopes.springs.shape[1]
    split, each = first + slopes.tolerances.shape[1], slopes.of_sensors.shape[2]
    normal = (
        np.zeros((split + len(slopes.of_sensors) * each,) * 2) if before is None else before.copy()
    )
    normal[:first, :first] = _gram(slopes.springs)
    normal[:first, first:split] = slopes.springs.T @ slopes.tolerances
    normal[:first, split:] = _sensor_gram(slopes.springs, slopes.of_sensors, shape)
    if before is None:
        normal[first:split, first:split] = _gram(slopes.tolerances)
        normal[first:split, split:] = _sensor_gram(slopes.tolerances, slopes.of_sensors, shape)
        normal[split:, first:split] = normal[first:split, split:].T
        for number, columns in enumerate(slopes.of_sensors):
            here = slice(split + each * number, split + each * (number + 1))
            normal[here, here] = columns.T @ columns
    normal[first:, :first] = normal[:first, first:].T
    return normal


def _gram(columns: Real) -> Real:
    """Return J^T J of columns in Fortran's order, which are not copied."""
    half = blas.dsyrk(1.0, columns, trans=1, lower=False)
    return np.asarray(np.triu(half) + np.triu(half, 1).T)


def _sensor_gram(columns: Real, of_sensors: Real, shape: tuple[int, ...]) -> Real:
    """Return J^T J of columns and those of each sensor, which has three rows; (n, n_all_own)."""
    whole, products = columns.T.reshape(-1, 2, *shape), []
    for number, sensor in enumerate(of_sensors):
        rows = whole[:, :, :, 3 * number : 3 * number + 3]
        products.append(rows.reshape(len(whole), -1) @ sensor)
    return np.hstack(products)


def bounded_solution(normal: Real, right: Real, bounded: Mask) -> Real:
    """Return the x that minimises x^T N x / 2 - b^T x with tolerances within their bound.

    Block principal pivoting (Judice and Pires 1994): all coordinates that violate the conditions
    of optimality change at once between free and held. Where that has not left fewer violations
    than ever before for some rounds, only the last of them changes until it has, which ends for
    every positive definite N (Murty 1974).

    Args:
        normal: N, positive definite; (n, n).
        right: b; (n,).
        bounded: which coordinates are tolerances, in standard deviations; (n,).
    """
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0  # a spring or damper of 0 stays 0
    inner = normal / np.outer(scale, scale)
    inner[np.diag_indices_from(inner)] += _RELATIVE_RIDGE
    push, limit = right / scale, np.where(bounded, BOUND, np.inf) * scale
    held = np.zeros(len(right))
    fewest, blocks = len(right) + 1, _BLOCK_ROUNDS
    while True:
        solution = _held_solution(inner, push, limit, held)
        is_free = held == 0
        beyond = is_free & (np.abs(solution) > limit)
        changing = np.flatnonzero(beyond | (_inward_slope(inner, push, solution, held) > 0))
        if not changing.size:
            return np.asarray(solution / scale)
        if changing.size < fewest:
            fewest, blocks = changing.size, _BLOCK_ROUNDS
        elif blocks:
            blocks -= 1
        else:
            changing = changing[-1:]
        held[changing] = np.where(is_free[changing], np.sign(solution[changing]), 0)


def _inward_slope(inner: Real, push: Real, solution: Real, held: Real) -> Real:
    """Return how fast the cost falls where held coordinates leave their bound; 0 below rounding."""
    slopes, places = np.zeros(len(push)), np.flatnonzero(held)
    rows = inner[places]
    slope = (rows @ solution - push[places]) * held[places]
    error = _SLOPE_ROUNDING * (np.abs(rows) @ np.abs(solution) + np.abs(push[places]))
    slopes[places] = np.where(slope > error, slope, 0.0)
    return slopes


def _held_solution(inner: Real, push: Real, limit: Real, held: Real) -> Real:
    """Return the solution with some coordinates held at a bound.

    Args:
        inner: N of unit diagonal; (n, n).
        push: b; (n,).
        limit: bounds; (n,).
        held: -1 or 1 at a bound, else 0; (n,).
    """
    free = held == 0
    solution = np.zeros(len(push))
    solution[~free] = held[~free] * limit[~free]
    # The transpose of the symmetric matrix is in Fortran's order, so that it is factored in place.
    matrix = inner[np.ix_(free, free)].T
    factor = scipy.linalg.cho_factor(matrix, overwrite_a=True, check_finite=False)
    rest = push[free] - inner[np.ix_(free, ~free)] @ solution[~free]
    solution[free] = scipy.linalg.cho_solve(factor, rest, check_finite=False)
    return solution
