"""Solution with terms that are no polynomials in s, such as appendages and hysteretic springs.

Z(s) = Z0(s) + U F(s) V', with Z0 a polynomial that has a modal form, and F(s) = f(s) (core_0 + s
core_1 + ...) of low rank. By the Woodbury identity (Golub and Van Loan 2013, ch. 2.1), in a form
without the inverse of F (which may be zero),

    Z^-1 b = y - Y (1 + F V' Y)^-1 F V' y,    y = Z0^-1 b,    Y = Z0^-1 U.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Complex, Real
from mbmodel.assembly import FrequencyDependentTerm
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.solver import Solver

_SINGULAR_SHIFT = 1e-13  # of the largest entry: what a singular matrix gets on its diagonal


@dataclass(frozen=True, eq=False)
class WoodburySolver:
    """A solver of Z(s) x = f with low-rank terms of any dependence on frequency.

    Args:
        polynomial_solver: of Z0.
        terms: what is added to Z0.
    """

    polynomial_solver: Solver
    terms: tuple[FrequencyDependentTerm, ...]

    def on_lines(self, span: slice) -> "WoodburySolver":
        """Return the solver of a run of lines."""
        return WoodburySolver(self.polynomial_solver.on_lines(span), self.terms)

    @cached_property
    def _sides(self) -> tuple[Real, Real]:
        """U and V of all terms side by side; (nv, r) and (nv, t)."""
        left = np.hstack([term.left for term in self.terms])
        return left, np.hstack([term.right for term in self.terms])

    @cached_property
    def _cores(self) -> Complex:
        """F at every line; (n_freq, r, t)."""
        left, right = self._sides
        laplace = self.polynomial_solver.laplace
        total = np.zeros((len(laplace), left.shape[1], right.shape[1]), complex)
        row = column = 0
        for term in self.terms:
            r, t = term.left.shape[1], term.right.shape[1]
            total[:, row : row + r, column : column + t] = term.at(laplace)
            row, column = row + r, column + t
        return total

    @cached_property
    def _forward(self) -> Complex:
        """Z0^-1 U; (nv, r, n_freq)."""
        return self.polynomial_solver.solve(self._sides[0][:, :, None])

    @cached_property
    def _backward(self) -> Complex:
        """Z0^-T V; (nv, t, n_freq)."""
        return self.polynomial_solver.solve(self._sides[1][:, :, None], transposed=True)

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
        through: Real | None = None,
    ) -> Complex:
        """Return Z^-1 f, or Z^-T f, times a factor of each line.

        Arguments and result are those of ``Solver.solve``.
        """
        y = self.polynomial_solver.solve(
            force, transposed=transposed, factor=factor, through=through
        )
        left, right = self._sides
        core, compliance, readout = self._cores, self._forward, right
        if transposed:
            core, compliance, readout = core.swapaxes(1, 2), self._backward, left
        coupling = real_times(readout.T, compliance).transpose(2, 0, 1)
        forces = core @ real_times(readout.T, y).transpose(2, 0, 1)
        corrections = _solve_lines(np.eye(core.shape[1]) + core @ coupling, forces)
        solution: Complex = y - (compliance.transpose(2, 0, 1) @ corrections).transpose(1, 2, 0)
        return solution


def _solve_lines(matrix: Complex, right: Complex) -> Complex:
    """Solve at every line, with a small shift if the matrix of some line is singular.

    A line exactly at an undamped resonance then gets a very large response instead of an error.
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right), complex)
    except np.linalg.LinAlgError:
        size = 1 + np.abs(matrix).max(axis=(1, 2), keepdims=True)
        shifted = matrix + _SINGULAR_SHIFT * size * np.eye(matrix.shape[1])
        return np.asarray(np.linalg.solve(shifted, right), complex)
