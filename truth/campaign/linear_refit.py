"""Linear least squares of a refit: what parameters follow of a change of the FRFs.

With the slopes J over the standard deviation of each value, and r the change over it,

    min_x  |r - J x|^2 + sum_tolerances x^2,   |x_tolerance| <= 2.5.
"""

from dataclasses import dataclass

import numpy as np

from truth.campaign.bounded_least_squares import bounded_solution
from truth.campaign.frf_sensitivities import stacked, unstacked
from truth.machine.station import Complex, Mask, Real


@dataclass(frozen=True, eq=False)
class LinearRefit:
    """Slopes of the FRFs of one machine and test, and the fit of a change by them.

    Args:
        deviation: sd of each value; (n_line, n_out, n_in).
        used: channels that count; (n_out,).
        shared: J of all but the sensors, over sd, real parts above imaginary; (2 n_value, n).
        own: the same of each sensor, its three rows alone; (n_sensor, 2 n_own, 9 to 15).
        normal: J^T J with the prior.
        bounded: which parameters are tolerances; (n_parameter,).
    """

    deviation: Real
    used: Mask
    shared: Real
    own: Real
    normal: Real
    bounded: Mask

    def fitted(self, change: Complex) -> Complex:
        """Return what stiffness, damping and tolerances can follow of a change of the FRFs."""
        return self.solve(change)[1]

    def solve(self, change: Complex, caution: float = 0.0) -> tuple[Real, Complex]:
        """Return the parameters that follow a change, and what they follow of it.

        Args:
            change: of the FRFs; like deviation.
            caution: part of the diagonal of stiffness and damping that is added to it.
        """
        right = self.adjoint(self.weighted(change))
        more = np.where(self.bounded, 0.0, caution * (np.diag(self.normal) + 1))
        solution = bounded_solution(self.normal + np.diag(more), right, self.bounded)
        return solution, self.follow(solution, change.shape)

    def fit_tolerances(self, change: Complex) -> tuple[Complex, float]:
        """Return what tolerances alone leave of a change, and its cost with their prior."""
        own = np.ix_(self.bounded, self.bounded)
        weighted = self.weighted(change)
        right = self.adjoint(weighted)[self.bounded]
        found = bounded_solution(self.normal[own], right, self.bounded[self.bounded])
        solution = np.zeros(len(self.bounded))
        solution[self.bounded] = found
        cost = weighted @ weighted - 2 * right @ found + found @ self.normal[own] @ found
        return change - self.follow(solution, change.shape), float(cost)

    def weighted(self, change: Complex) -> Real:
        """Return a change of the FRFs over its standard deviation, real parts above imaginary."""
        return stacked(change / self.deviation * self.used[:, None])

    def follow(self, solution: Real, shape: tuple[int, ...]) -> Complex:
        """Return how the FRFs follow parameters, to first order; of a shape like deviation."""
        split = self.shared.shape[1]
        found = unstacked(self.shared @ solution[:split], shape)
        sensors = solution[split:].reshape(len(self.own), -1)
        for number, (columns, own) in enumerate(zip(self.own, sensors, strict=True)):
            rows = slice(3 * number, 3 * number + 3)
            found[:, rows] += unstacked(columns @ own, found[:, rows].shape)
        return found * np.where(np.isfinite(self.deviation), self.deviation, 0.0)

    def whitened_motion(self, solution: Real) -> Real:
        """Return J times parameters, like ``weighted``."""
        return self.weighted(self.follow(solution, self.deviation.shape))

    def adjoint(self, weighted: Real) -> Real:
        """Return J^T times a whitened change; (n_parameter,)."""
        whole = unstacked(weighted, self.deviation.shape)
        own = [
            columns.T @ stacked(whole[:, 3 * number : 3 * number + 3])
            for number, columns in enumerate(self.own)
        ]
        return np.concatenate([self.shared.T @ weighted, *own])
