"""Normal equations of many sensors: dense in shared coordinates, one block for each sensor.

A sensor's own parameters (gains, rotation, position) change its own channels alone. With shared
coordinates s and blocks o_b, the normal equations are bordered block-diagonal (an arrow matrix),

    [ S    C' ] [s]   [g_s]          S s + sum_b C_b' o_b = g_s
    [ C    O  ] [o] = [g_o],         C_b s + O_b o_b = g_b.

The blocks are eliminated one by one, which leaves the Schur complement S - sum_b C_b' O_b^-1 C_b
(Boyd and Vandenberghe, Convex Optimization, 2004, app. C.4). A machine with hundreds of sensors
thus costs what its shared parameters cost.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Integers, Mask, Real


@dataclass(frozen=True, eq=False)
class ArrowMatrix:
    """Symmetric bordered block-diagonal (arrow) matrix.

    Args:
        shared: S; (n_s, n_s).
        cross: C_b; (n_block, n_own, n_s), zero in rows that a block does not have.
        blocks: O_b; (n_block, n_own, n_own), zero in rows and columns that a block does not have.
        shared_coordinates: coordinate of each row of S; (n_s,).
        block_coordinates: coordinate of each row of a block, -1 for a missing row;
            (n_block, n_own).
    """

    shared: Real
    cross: Real
    blocks: Real
    shared_coordinates: Integers
    block_coordinates: Integers

    @property
    def size(self) -> int:
        """Number of rows of the whole matrix."""
        return len(self.shared_coordinates) + int((self.block_coordinates >= 0).sum())

    def diagonal(self) -> Real:
        """Return the diagonal; (n,)."""
        diagonal = np.zeros(self.size + 1)
        diagonal[self.block_coordinates] = np.diagonal(self.blocks, axis1=1, axis2=2)
        diagonal[self.shared_coordinates] = np.diag(self.shared)
        return diagonal[:-1]

    def dense(self) -> Real:
        """Return the whole matrix; (n, n)."""
        n = self.size
        whole = np.zeros((n + 1, n + 1))  # the last row takes what a block does not have
        whole[np.ix_(self.shared_coordinates, self.shared_coordinates)] = self.shared
        for at, block, cross in zip(self.block_coordinates, self.blocks, self.cross, strict=True):
            whole[np.ix_(at, at)] = block
            whole[np.ix_(at, self.shared_coordinates)] = cross
            whole[np.ix_(self.shared_coordinates, at)] = cross.T
        return whole[:n, :n]

    def __add__(self, matrix: "ArrowMatrix") -> "ArrowMatrix":
        """Return the sum with a matrix of equal structure."""
        return self._like(
            self.shared + matrix.shared, self.cross + matrix.cross, self.blocks + matrix.blocks
        )

    def __sub__(self, matrix: "ArrowMatrix") -> "ArrowMatrix":
        """Return the difference from a matrix of equal structure."""
        return self._like(
            self.shared - matrix.shared, self.cross - matrix.cross, self.blocks - matrix.blocks
        )

    def __mul__(self, factor: float) -> "ArrowMatrix":
        """Return the matrix times a factor, as for so many times as many data."""
        return self._like(factor * self.shared, factor * self.cross, factor * self.blocks)

    def _like(self, shared: Real, cross: Real, blocks: Real) -> "ArrowMatrix":
        """Return a matrix of equal structure with other entries."""
        return ArrowMatrix(shared, cross, blocks, self.shared_coordinates, self.block_coordinates)

    def multiply(self, x: Real) -> Real:
        """Return the matrix times a vector; (n,)."""
        padded = np.append(x, 0.0)
        of_blocks, of_shared = padded[self.block_coordinates], padded[self.shared_coordinates]
        product = np.zeros(self.size + 1)
        product[self.block_coordinates] = (
            np.einsum("bij,bj->bi", self.blocks, of_blocks) + self.cross @ of_shared
        )
        product[self.shared_coordinates] = self.shared @ of_shared + np.einsum(
            "bis,bi->s", self.cross, of_blocks
        )
        return product[:-1]

    def solve(self, right: Real, added: Real, free: Mask | None = None) -> Real:
        """Solve ``(A + diag(added)) x = right`` by Schur complement; x is zero where not free.

        The reduced equations are scaled to a unit diagonal and solved by Cholesky factorisation.

        Args:
            right: right-hand side; (n,).
            added: added to the diagonal; (n,).
            free: whether each coordinate is free, all if None; (n,).

        Returns:
            x; (n,).

        Raises:
            numpy.linalg.LinAlgError: the matrix is not positive definite.
        """
        kept = np.append(np.ones(self.size, bool) if free is None else free, False)
        extra, target = np.append(added, 1.0), np.append(right, 0.0) * kept
        at = self.block_coordinates
        inside = kept[at][:, :, None] * kept[at][:, None, :]
        unit = np.eye(at.shape[1])
        blocks = self.blocks * inside + unit * np.where(kept[at], extra[at], 1.0)[:, None, :]
        cross = self.cross * (kept[at][:, :, None] & kept[self.shared_coordinates])
        both = np.concatenate([cross, target[at][:, :, None]], axis=2)
        solved = np.linalg.solve(blocks, both) if len(at) else both
        is_free = kept[self.shared_coordinates]
        shared = self.shared * np.outer(is_free, is_free)
        shared += np.diag(np.where(is_free, extra[self.shared_coordinates], 1.0))
        eliminated = np.einsum("bis,bit->st", cross, solved, optimize=True)
        reduced = shared - eliminated[:, :-1]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(shared), np.finfo(float).tiny))
        factor = scipy.linalg.cho_factor(reduced * np.outer(scale, scale), check_finite=False)
        reduced_target = (target[self.shared_coordinates] - eliminated[:, -1]) * scale
        x_shared = scipy.linalg.cho_solve(factor, reduced_target, check_finite=False) * scale
        solution = np.zeros(self.size + 1)
        solution[at] = (solved[:, :, -1] - solved[:, :, :-1] @ x_shared) * kept[at]
        solution[self.shared_coordinates] = x_shared
        x: Real = solution[:-1] * kept[:-1]
        return x


QuadraticModel = tuple[
    float, Real, ArrowMatrix
]  # J, its gradient and its normal equations at a point
