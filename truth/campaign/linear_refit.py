"""Linear least squares of a refit: what parameters follow of a change of the FRFs.

With the slopes J over the standard deviation of each value, and r the change over it,

    min_x  |r - J x|^2 + sum_tolerances x^2,   |x_tolerance| <= 2.5.
"""

from dataclasses import dataclass

import numpy as np

from truth.campaign.bounded_least_squares import bounded_solution
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
