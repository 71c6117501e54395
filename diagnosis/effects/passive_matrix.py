"""Symmetric matrices without negative eigenvalues: stiffness or damping of a passive link.

They are written

    K = (1 + N) diag(k) (1 + N),   k >= 0,   N = [[0, n_xy, n_xz], [n_xy, 0, n_yz], [.., .., 0]],

that is as springs along the columns of 1 + N, |n| <= 1. K is linear in k about no link, as score
tests and fits need. Every symmetric matrix without negative eigenvalues has such a form.
"""

import numpy as np

from identification.words import Real


def build_passive(sizes: Real, off_diagonal: Real) -> Real:
    """Return the matrix (1 + N) diag(k) (1 + N) of springs or dampers; (3, 3).

    Args:
        sizes: k; (3,).
        off_diagonal: n_xy, n_xz and n_yz; (3,).
    """
    columns = build_columns(off_diagonal)
    return (columns * sizes) @ columns


def slope_passive(sizes: Real, off_diagonal: Real) -> Real:
    """Return the slopes of ``build_passive`` by the sizes, then by N; (6, 3, 3)."""
    columns = build_columns(off_diagonal)
    along = columns.T[:, :, None] * columns.T[:, None, :]
    half = (build_columns(np.eye(3)) - np.eye(3)) @ (sizes[:, None] * columns)
    return np.concatenate([along, half + half.swapaxes(-1, -2)])


def build_columns(off_diagonal: Real) -> Real:
    """Return 1 + N, whose columns are the axes; (..., 3, 3).

    Args:
        off_diagonal: n_xy, n_xz and n_yz; (..., 3).
    """
    columns = np.broadcast_to(np.eye(3), (*off_diagonal.shape[:-1], 3, 3)).copy()
    rows, ends = np.triu_indices(3, k=1)
    columns[..., rows, ends] = columns[..., ends, rows] = off_diagonal
    return columns
