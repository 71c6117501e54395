"""Projection of whitened channels on the span of rigid motions and free shapes, and off it."""

from dataclasses import dataclass

import numpy as np

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
