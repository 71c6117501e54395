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
        return ArrowSolver(self, added).solve(right, free)


class ArrowSolver:
    """Solver of ``(A + diag(added)) x = right`` for several sets of free coordinates.

    An active-set method frees and fixes a few coordinates at a time. Only blocks in which some were
    freed or fixed are eliminated anew.

    Args:
        matrix: A.
        added: added to the diagonal; (n,).
    """

    def __init__(self, matrix: ArrowMatrix, added: Real) -> None:
        self._matrix, self._added = matrix, np.append(added, 1.0)
        shape = matrix.block_coordinates.shape
        self._is_free = np.zeros(shape, bool)
        self._inverses = np.zeros((*shape, shape[1]))
        self._products = np.zeros_like(matrix.cross)
        self._eliminated: Real = np.zeros_like(matrix.shared)
        self._is_begun = False

    def solve(self, right: Real, free: Mask | None = None) -> Real:
        """Return x, zero where not free; (n,).

        Args:
            right: right-hand side; (n,).
            free: whether each coordinate is free, all if None; (n,).

        Raises:
            numpy.linalg.LinAlgError: the matrix is not positive definite.
        """
        matrix = self._matrix
        kept = np.append(np.ones(matrix.size, bool) if free is None else free, False)
        target = np.append(right, 0.0) * kept
        at, shared_coordinates = matrix.block_coordinates, matrix.shared_coordinates
        self._eliminate(kept[at])
        of_blocks = (self._inverses @ target[at][:, :, None])[:, :, 0]
        is_free = kept[shared_coordinates]
        diagonal = np.where(is_free, self._added[shared_coordinates], 1.0)
        inside = np.outer(is_free, is_free)
        scale = np.diag(matrix.shared) * is_free + diagonal
        scale = 1.0 / np.sqrt(np.maximum(scale, np.finfo(float).tiny))
        reduced = np.where(inside, matrix.shared - self._eliminated, 0.0)
        reduced[np.diag_indices_from(reduced)] += diagonal
        factor = scipy.linalg.cho_factor(reduced * np.outer(scale, scale), check_finite=False)
        coupled = np.einsum("bis,bi->s", matrix.cross, of_blocks, optimize=True)
        reduced_target = (target[shared_coordinates] - coupled * is_free) * scale
        x_shared = scipy.linalg.cho_solve(factor, reduced_target, check_finite=False) * scale
        solution = np.zeros(matrix.size + 1)
        solution[at] = (of_blocks - self._products @ x_shared) * kept[at]
        solution[shared_coordinates] = x_shared
        return solution[:-1] * kept[:-1]

    def _eliminate(self, is_free: Mask) -> None:
        """Eliminate the blocks whose free coordinates have changed; (n_block, n_own)."""
        cross = self._matrix.cross
        changed = np.flatnonzero((is_free != self._is_free).any(axis=1))
        is_renewed = not self._is_begun or 2 * len(changed) > len(cross)
        if is_renewed:
            changed = np.arange(len(cross))
        else:
            self._eliminated = self._eliminated - _contract(cross[changed], self._products[changed])
        self._is_free, self._is_begun = is_free, True
        if not len(changed):
            return
        rows, at = is_free[changed], self._matrix.block_coordinates[changed]
        blocks = self._matrix.blocks[changed] * (rows[:, :, None] & rows[:, None, :])
        blocks += np.eye(at.shape[1]) * np.where(rows, self._added[at], 1.0)[:, None, :]
        # Fixed coordinates have a unit row, and take no part.
        inverses = np.linalg.inv(blocks) * (rows[:, :, None] & rows[:, None, :])
        self._inverses[changed] = inverses
        self._products[changed] = inverses @ cross[changed]
        eliminated = _contract(cross[changed], self._products[changed])
        self._eliminated = eliminated if is_renewed else self._eliminated + eliminated


def _contract(cross: Real, products: Real) -> Real:
    """Return the sum of C' P over blocks; (n_s, n_s)."""
    n_block, n_own, size = cross.shape
    rows = n_block * n_own, size
    return cross.reshape(rows).T @ products.reshape(rows)


QuadraticModel = tuple[
    float, Real, ArrowMatrix
]  # J, its gradient and its normal equations at a point
