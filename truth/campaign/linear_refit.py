"""Linear least squares of a refit: what parameters follow of a change of the FRFs.

With the slopes J over the standard deviation of each value, and r the change over it,

    min_x  |r - J x|^2 + sum_tolerances x^2,   |x_tolerance| <= 2.5.

Normal equations of a refit, and their solution with tolerances within their bound.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.linalg import blas

from truth.campaign.frf_sensitivities import Jacobian, join_parts, stack_parts
from truth.machine.station import Complex, Mask, Real


@dataclass(frozen=True, eq=False)
class LinearRefit:
    """Slopes of the FRFs of one machine and test, and the fit of a change by them.

    Args:
        deviation: sd of each value; (n_line, n_out, n_in).
        used: channels that count; (n_out,).
        slopes: J over sd. Parameters are springs, tolerances, and then each sensor's own.
        normal: J^T J with the prior.
    """

    deviation: Real
    used: Mask
    slopes: Jacobian
    normal: Real

    @property
    def bounded(self) -> Mask:
        """Which parameters are tolerances; (n_parameter,)."""
        return np.arange(len(self.normal)) >= self.n_springs

    @property
    def n_springs(self) -> int:
        """Number of stiffness and damping parameters, which come first."""
        return int(self.slopes.springs.shape[1])

    def fit_change(self, change: Complex) -> Complex:
        """Return what stiffness, damping and tolerances can follow of a change of the FRFs."""
        return self.solve(change)[1]

    def solve(self, change: Complex, caution: float = 0.0) -> tuple[Real, Complex]:
        """Return the parameters that follow a change, and what they follow of it.

        Args:
            change: of the FRFs; like deviation.
            caution: part of the diagonal of stiffness and damping that is added to it.
        """
        right = self.adjoint(self.whiten(change))
        more = np.where(self.bounded, 0.0, caution * (np.diag(self.normal) + 1))
        solution = bounded_solution(self.normal + np.diag(more), right, self.bounded)
        return solution, self.follow(solution, change.shape)

    def fit_tolerances(self, change: Complex) -> tuple[Complex, float]:
        """Return what tolerances alone leave of a change, and its cost with their prior."""
        first = self.n_springs
        weighted, normal = self.whiten(change), self.normal[first:, first:]
        right = self._adjoint_of_tolerances(weighted)
        tolerances = bounded_solution(normal, right, self.bounded[first:])
        solution = np.append(np.zeros(first), tolerances)
        cost = weighted @ weighted - 2 * right @ tolerances + tolerances @ normal @ tolerances
        return change - self.follow(solution, change.shape), float(cost)

    def whiten(self, change: Complex) -> Real:
        """Return a change of the FRFs over its standard deviation, real parts above imaginary."""
        return stack_parts(change / self.deviation * self.used[:, None])

    def follow(self, solution: Real, shape: tuple[int, ...]) -> Complex:
        """Return how the FRFs follow parameters, to first order; of a shape like deviation."""
        first, split = self.n_springs, self.n_springs + self.slopes.tolerances.shape[1]
        values = self.slopes.tolerances @ solution[first:split]
        if solution[:first].any():
            values += self.slopes.springs @ solution[:first]
        change = join_parts(values, shape)
        sensors = solution[split:].reshape(len(self.slopes.of_sensors), -1)
        for number, (columns, errors) in enumerate(
            zip(self.slopes.of_sensors, sensors, strict=True)
        ):
            rows = slice(3 * number, 3 * number + 3)
            change[:, rows] += join_parts(columns @ errors, change[:, rows].shape)
        return change * np.where(np.isfinite(self.deviation), self.deviation, 0.0)

    def adjoint(self, weighted: Real) -> Real:
        """Return J^T times a whitened change; (n_parameter,)."""
        return np.concatenate(
            [self.slopes.springs.T @ weighted, self._adjoint_of_tolerances(weighted)]
        )

    def _adjoint_of_tolerances(self, weighted: Real) -> Real:
        """Return the part of J^T times a whitened change that belongs to tolerances."""
        whole = join_parts(weighted, self.deviation.shape)
        of_sensors = [
            columns.T @ stack_parts(whole[:, 3 * number : 3 * number + 3])
            for number, columns in enumerate(self.slopes.of_sensors)
        ]
        return np.concatenate([self.slopes.tolerances.T @ weighted, *of_sensors])


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
