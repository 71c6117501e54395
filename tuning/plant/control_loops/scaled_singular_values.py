"""Largest singular values of matrices between signals of different units.

sigma(D M D^-1) with Perron's scaling of |M| as the diagonal D has no units, and bounds the
structured singular value of diagonal changes from above (Safonov 1982, IEE Proceedings D 129,
251-256).
"""

import numpy as np

from identification.words import Complex, Real

_BALANCING_ROUNDS = 40  # each takes the fourth root of a wrong unit, and neighbours' errors

# Of the largest entry, which couples matrices that fall apart: half of the digits, so that their
# Perron vectors, which spread by its root, keep the others.
_COUPLING_FLOOR = float(np.sqrt(np.finfo(float).eps))


def singular_values(matrices: Complex) -> Real:
    """Return the largest singular value of each matrix; (n_freq,)."""
    return np.linalg.norm(matrices, 2, axis=(-2, -1))


def scaled_singular_values(matrices: Complex) -> Real:
    """Return sigma(D M D^-1) of each matrix, D Perron's scaling of |M|; (n_freq,).

    With x and y the right and left Perron vectors of |M|, D = diag sqrt(y / x).
    """
    if matrices.shape[-1] == 1:
        return np.abs(matrices[:, 0, 0])
    matrices = _balance(matrices)
    # Loops that do not act on each other leave |M| reducible: a small floor couples them.
    sizes = np.abs(matrices)
    sizes = sizes + _COUPLING_FLOOR * sizes.max(axis=(-2, -1), keepdims=True)
    scale = np.sqrt(_perron_vectors(sizes.swapaxes(-2, -1)) / _perron_vectors(sizes))
    return singular_values(scale[:, :, None] * matrices / scale[:, None, :])


def _balance(matrices: Complex) -> Complex:
    """Return D M D^-1 with rows and columns of like size, where both are above zero.

    Osborne's iteration (1960, Journal of the ACM 7, 338-345) takes out units of any size, between
    which Perron vectors would lose their digits.
    """
    balanced = matrices
    off_diagonal = ~np.eye(matrices.shape[-1], dtype=bool)
    for _ in range(_BALANCING_ROUNDS):
        sizes = np.abs(balanced) * off_diagonal
        rows, columns = sizes.sum(axis=-1), sizes.sum(axis=-2)
        is_coupled = (rows > 0) & (columns > 0)
        ratio = np.where(is_coupled, columns, 1.0) / np.where(is_coupled, rows, 1.0)
        scale = ratio**0.25  # half a step: all rows change at once
        balanced = scale[:, :, None] * balanced / scale[:, None, :]
    return balanced


def _perron_vectors(sizes: Real) -> Real:
    """Return the positive eigenvector of each matrix of positive entries; (n_freq, n)."""
    values, vectors = np.linalg.eig(sizes)
    chosen = np.argmax(values.real, axis=-1)
    perron = np.take_along_axis(vectors, chosen[:, None, None], axis=-1)[..., 0]
    return np.maximum(np.abs(perron), np.finfo(float).eps)
