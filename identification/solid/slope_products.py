"""Gradient and Gauss-Newton curvature of a fit of sensor errors, from the non-zero slopes alone.

An error p changes the whitened rows B of few channels: its slope B_p has the rows r_i of entries i
at channels c_i. With C the power of the motion, the positive part of B^+ (G - V) B^+^T, the sums

    g_p = -2 sum_i r_i . [B^+ (G - V) P]_c(i),    N_pq = sum_ij P_c(i)c(j) r_i^T C r_j

run over the entries of p and of q (Gauss-Newton, as of errors in variables; Fuller 1987, ch. 2).
Delays tau are errors of all entries of their channel, with A_p = P B_p B^+:

    g_m = -2 sum_c P_mc W1_mc,   N_pm = sum_c (A_p)_mc W1_mc,   N_mn = P_mn W2_mn.

Projection of whitened channels on the span of rigid motions and free shapes, and off it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv

from identification.solid.sensor_errors import SlopeEntries
from identification.words import Mask, Real

_MIN_COLUMN_NORM = 1e-9  # norm of a column over the largest below which it is rounding
_RIGID_RANK_TOLERANCE = 1e-6  # singular value over the largest below which a motion is undetermined


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection of a group's whitened channels on the span of rigid motions and off it.

    Args:
        residual_projector: P; (n_channel, n_channel).
        inverse: B^+; (n_column, n_channel).
        rank: rank of B.
    """

    residual_projector: Real
    inverse: Real
    rank: int


def project(rows: Real, mask: Mask) -> Projection:
    """Compute the projector off the span of rows, and their pseudo-inverse.

    Args:
        rows: B; (n_channel, n_column).
        mask: channels that were measured; (n_channel,).
    """
    rows = rows * mask[:, None]
    norm = np.sqrt(np.einsum("cq,cq->q", rows, rows))
    has_motion = norm > _MIN_COLUMN_NORM * norm.max(initial=0.0)
    rows, norm = rows * has_motion, np.where(has_motion, norm, 1.0)
    left, values, right = np.linalg.svd(rows / norm, full_matrices=False)
    kept = int((values > _RIGID_RANK_TOLERANCE * max(values[0], 1e-300)).sum())
    left, values, right = left[:, :kept], values[:kept], right[:kept]
    residual_projector = np.diag(mask.astype(float)) - left @ left.T
    return Projection(residual_projector, ((right.T / values) @ left.T) / norm[:, None], kept)


class SlopeProducts:
    """Sums of products of slopes, over the entries of each error.

    Args:
        entries: slopes of the rows, not whitened.
        scale: 1 / noise of each channel; (n_channel,).
        count: number of errors.
    """

    def __init__(self, entries: SlopeEntries, scale: Real, count: int) -> None:
        self._channel = entries.channel
        self._rows = entries.rows * scale[entries.channel, None]
        self._starts = np.flatnonzero(np.diff(entries.error, prepend=-1))
        self._errors = entries.error[self._starts]
        self._late = slice(count - len(scale), count)

    def add_to(
        self,
        gradient: Real,
        information: Real,
        projection: Projection,
        clean: Real,
        delayed: tuple[Real, Real] | None,
    ) -> None:
        """Add gradient and information of one group, or of many data of one group.

        Args:
            gradient: of all errors, changed in place; (..., n_error).
            information: N of all errors, changed in place; (..., n_error, n_error).
            projection: P and B^+.
            clean: G - V; (..., n_channel, n_channel).
            delayed: W1 and W2, (..., n_channel, n_channel) each; None: delays are no errors.
        """
        projector, inverse = projection.residual_projector, projection.inverse[:6]
        mapped = inverse @ clean
        motion = nearest_semidefinite(mapped @ inverse.T)
        of_channels = np.swapaxes(mapped @ projector, -1, -2)[..., self._channel, :]
        slopes = np.einsum("...iq,iq->...i", of_channels, self._rows)
        gradient[..., self._errors] -= 2 * np.add.reduceat(slopes, self._starts, axis=-1)
        products = (self._rows @ motion) @ self._rows.T
        products *= projector[self._channel][:, self._channel]
        information[..., self._errors[:, None], self._errors] += self._sum_rows(
            np.add.reduceat(products, self._starts, axis=-1)
        )
        if delayed is None:
            return
        first, second = delayed
        gradient[..., self._late] -= 2 * (projector * first).sum(axis=-1)
        crossed = (self._rows @ (inverse @ np.swapaxes(first, -1, -2))) * projector[self._channel]
        of_errors = self._sum_rows(crossed)
        late = np.arange(self._late.start, self._late.stop)
        information[..., self._errors[:, None], late] += of_errors
        information[..., late[:, None], self._errors] += np.swapaxes(of_errors, -1, -2)
        information[..., self._late, self._late] += projector * second

    def _sum_rows(self, products: Real) -> Real:
        """Sum the rows of the entries of each error; (..., n_error_with_entries, n)."""
        return np.add.reduceat(products, self._starts, axis=-2)


def solve_definite(matrix: Real, right_side: Real) -> Real:
    """Solve a symmetric positive definite system by Cholesky's factors.

    Args:
        matrix: its upper triangle is used; (n, n).
        right_side: (n,).
    """
    # The transpose of an array in C order is in the order of Fortran, so that it is not copied.
    _, solution, failed = dposv(matrix.T, right_side, lower=1)
    return np.asarray(np.linalg.solve(matrix, right_side) if failed else solution, float)


def nearest_semidefinite(matrices: Real) -> Real:
    """Return the nearest positive semidefinite matrix of each symmetric one; (..., n, n).

    Subtracting noise can leave negative eigenvalues.
    """
    values, vectors = np.linalg.eigh(matrices)
    scaled = vectors * np.maximum(values, 0)[..., None, :]
    return np.asarray(scaled @ np.swapaxes(vectors, -1, -2))
