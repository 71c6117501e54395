r"""Normal equations of many sensors: dense in what all share, a block for each sensor.

A sensor's own parameters (gains, rotation, place) move its own rows alone. With shared s and
blocks o_b the equations are an arrow,

    [ S    C' ] [s]   [g_s]          S s + sum_b C_b' o_b = g_s
    [ C    O  ] [o] = [g_o],         C_b s + O_b o_b = g_b,

so that the blocks are eliminated one by one (Schur complement): a machine with hundreds of sensors
costs what its shared parameters do.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Integers, Mask, Real


@dataclass(frozen=True, eq=False)
class Arrow:
    """A symmetric matrix in the form above.

    Args:
        shared: S; (n_s, n_s).
        cross: C_b; (n_block, n_own, n_s), zero beyond a block's own.
        own: O_b; (n_block, n_own, n_own), likewise.
        shared_at: coordinate of each shared row; (n_s,).
        own_at: coordinate of each row of a block, -1 where it has none; (n_block, n_own).
    """

    shared: Real
    cross: Real
    own: Real
    shared_at: Integers
    own_at: Integers

    @property
    def size(self) -> int:
        """Rows of the whole matrix."""
        return len(self.shared_at) + int((self.own_at >= 0).sum())

    def diagonal(self) -> Real:
        """(n,)."""
        found = np.zeros(self.size + 1)
        found[self.own_at] = np.diagonal(self.own, axis1=1, axis2=2)
        found[self.shared_at] = np.diag(self.shared)
        return found[:-1]

    def dense(self) -> Real:
        """(n, n)."""
        n = self.size
        whole = np.zeros((n + 1, n + 1))  # the last takes what a block does not have
        whole[np.ix_(self.shared_at, self.shared_at)] = self.shared
        for at, own, cross in zip(self.own_at, self.own, self.cross, strict=True):
            whole[np.ix_(at, at)] = own
            whole[np.ix_(at, self.shared_at)] = cross
            whole[np.ix_(self.shared_at, at)] = cross.T
        return whole[:n, :n]

    def __add__(self, other: "Arrow") -> "Arrow":
        """Sum with one of the same form."""
        return self._like(
            self.shared + other.shared, self.cross + other.cross, self.own + other.own
        )

    def __sub__(self, other: "Arrow") -> "Arrow":
        """Difference from one of the same form."""
        return self._like(
            self.shared - other.shared, self.cross - other.cross, self.own - other.own
        )

    def __mul__(self, factor: float) -> "Arrow":
        """So many times as many data."""
        return self._like(factor * self.shared, factor * self.cross, factor * self.own)

    def _like(self, shared: Real, cross: Real, own: Real) -> "Arrow":
        return Arrow(shared, cross, own, self.shared_at, self.own_at)

    def times(self, x: Real) -> Real:
        """The matrix times a vector; (n,)."""
        padded = np.append(x, 0.0)
        own, shared = padded[self.own_at], padded[self.shared_at]
        found = np.zeros(self.size + 1)
        found[self.own_at] = np.einsum("bij,bj->bi", self.own, own) + self.cross @ shared
        found[self.shared_at] = self.shared @ shared + np.einsum("bis,bi->s", self.cross, own)
        return found[:-1]

    def solve(self, right: Real, added: Real, free: Mask | None = None) -> Real:
        """X of (A + diag(added)) x = right, zero where it is not free; (n,).

        Raises:
            numpy.linalg.LinAlgError: the matrix is not positive definite.
        """
        kept = np.append(np.ones(self.size, bool) if free is None else free, False)
        more, wanted = np.append(added, 1.0), np.append(right, 0.0) * kept
        at = self.own_at
        inside = kept[at][:, :, None] * kept[at][:, None, :]
        unit = np.eye(at.shape[1])
        own = self.own * inside + unit * np.where(kept[at], more[at], 1.0)[:, None, :]
        cross = self.cross * (kept[at][:, :, None] & kept[self.shared_at])
        both = np.concatenate([cross, wanted[at][:, :, None]], axis=2)
        solved = np.linalg.solve(own, both) if len(at) else both
        chosen = kept[self.shared_at]
        shared = self.shared * np.outer(chosen, chosen)
        shared += np.diag(np.where(chosen, more[self.shared_at], 1.0))
        eliminated = np.einsum("bis,bit->st", cross, solved, optimize=True)
        reduced = shared - eliminated[:, :-1]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(shared), np.finfo(float).tiny))
        factor = scipy.linalg.cho_factor(reduced * np.outer(scale, scale), check_finite=False)
        aim = (wanted[self.shared_at] - eliminated[:, -1]) * scale
        x_shared = scipy.linalg.cho_solve(factor, aim, check_finite=False) * scale
        found = np.zeros(self.size + 1)
        found[at] = (solved[:, :, -1] - solved[:, :, :-1] @ x_shared) * kept[at]
        found[self.shared_at] = x_shared
        x: Real = found[:-1] * kept[:-1]
        return x


Quadratic = tuple[float, Real, Arrow]  # a cost, its gradient and its normal equations somewhere
