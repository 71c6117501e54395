r"""What hangs on a machine and depends on frequency in its own way: appendages, lossy springs.

Z(s) = Z0(s) + U F(s) V', Z0 a polynomial with its modal form, F(s) = f(s) (core_0 + s core_1 + ..)
of low rank. By Woodbury's identity, which needs no inverse of F (sizes may be zero),

    Z^-1 b = y - Y (1 + F V' Y)^-1 F V' y,    y = Z0^-1 b,    Y = Z0^-1 U.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Complex, Real
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.solver import Solver
from mbmodel.model import ShapedTerm

_NEARLY = 1e-13  # of the largest entry, what a singular matrix gets on its diagonal


@dataclass(frozen=True, eq=False)
class ShapedSolver:
    """Solves Z(s) x = f with terms of any dependence on frequency.

    Args:
        plain: of Z0.
        terms: what is added.
    """

    plain: Solver
    terms: tuple[ShapedTerm, ...]

    @cached_property
    def _sides(self) -> tuple[Real, Real]:
        """U and V of all terms side by side; (nv, r) and (nv, t)."""
        left = np.hstack([term.left for term in self.terms])
        return left, np.hstack([term.right for term in self.terms])

    @cached_property
    def _cores(self) -> Complex:
        """F at every line; (n_freq, r, t)."""
        left, right = self._sides
        laplace = self.plain.laplace
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
        return self.plain.solve(self._sides[0][:, :, None])

    @cached_property
    def _backward(self) -> Complex:
        """Z0^-T V; (nv, t, n_freq)."""
        return self.plain.solve(self._sides[1][:, :, None], transposed=True)

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
        through: Real | None = None,
    ) -> Complex:
        """Z^-1 f, or Z^-T f, times a factor of each line; as ``Solver.solve``."""
        y = self.plain.solve(force, transposed=transposed, factor=factor, through=through)
        left, right = self._sides
        core, moved, felt = self._cores, self._forward, right
        if transposed:
            core, moved, felt = core.swapaxes(1, 2), self._backward, left
        seen = real_times(felt.T, moved).transpose(2, 0, 1)
        pushed = core @ real_times(felt.T, y).transpose(2, 0, 1)
        taken = _solved(np.eye(core.shape[1]) + core @ seen, pushed)
        found: Complex = y - (moved.transpose(2, 0, 1) @ taken).transpose(1, 2, 0)
        return found


def _solved(matrix: Complex, right: Complex) -> Complex:
    """Solve at every line; a line exactly at an undamped resonance answers hugely, not never."""
    try:
        return np.asarray(np.linalg.solve(matrix, right), complex)
    except np.linalg.LinAlgError:
        size = 1 + np.abs(matrix).max(axis=(1, 2), keepdims=True)
        moved = matrix + _NEARLY * size * np.eye(matrix.shape[1])
        return np.asarray(np.linalg.solve(moved, right), complex)
