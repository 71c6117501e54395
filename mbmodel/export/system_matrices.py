"""The four matrices of a linear system, and its response."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Complex, Real


@dataclass(frozen=True, eq=False)
class SystemMatrices:
    """A linear system x' = A x + B u, y = C x + D u.

    Args:
        a: (n, n).
        b: (n, n_in).
        c: (n_out, n).
        d: (n_out, n_in).
    """

    a: Real
    b: Real
    c: Real
    d: Real

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def balance_units(self) -> "SystemMatrices":
        """Return the system with units of its states in which the entries of A are of like size."""
        if not self.order:
            return self
        a, (units, _) = scipy.linalg.matrix_balance(self.a, permute=False, separate=True)
        return SystemMatrices(a, self.b / units[:, None], self.c * units, self.d)

    def at(self, laplace: Complex) -> Complex:
        """Return C (s - A)^-1 B + D at each s; (n_freq, n_out, n_in).

        Args:
            laplace: s [rad/s], or z of a system in discrete time; (n_freq,).
        """
        system = self.balance_units()
        values = np.empty((len(laplace), *self.d.shape), complex)
        unit = np.eye(system.order)
        for k, s in enumerate(laplace):
            values[k] = system.c @ np.linalg.solve(s * unit - system.a, system.b) + system.d
        return values

    def join(self, parallel: "SystemMatrices") -> "SystemMatrices":
        """Return the sum of two systems, the states of this one first."""
        return SystemMatrices(
            scipy.linalg.block_diag(self.a, parallel.a),
            np.vstack([self.b, parallel.b]),
            np.hstack([self.c, parallel.c]),
            self.d + parallel.d,
        )
