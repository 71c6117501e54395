"""Rotation vectors of several sensors at once: their matrices, and two rotations in succession.

A fit asks for few rotations and often, so that these formulas are faster than general libraries.
"""

import numpy as np

from identification.words import Real

_UNIT_MATRIX = np.eye(3)


def cross_product(first: Real, second: Real) -> Real:
    """Compute the cross product along the last axis; (..., 3)."""
    x, y, z = first[..., 0], first[..., 1], first[..., 2]
    u, v, w = second[..., 0], second[..., 1], second[..., 2]
    product = np.empty(np.broadcast_shapes(first.shape, second.shape))
    product[..., 0] = y * w - z * v
    product[..., 1] = z * u - x * w
    product[..., 2] = x * v - y * u
    return product


def rotation_matrices(vectors: Real) -> Real:
    """Compute rotation matrices of rotation vectors (Rodrigues); (n, 3, 3).

    R = (1 - b t^2) 1 + a K + b v v^T, with t the angle, K the skew matrix of the vector v,
    a = sinc(t) and b = sinc(t / 2)^2 / 2.

    Args:
        vectors: axes times angles [rad]; (n, 3).
    """
    squares = np.einsum("nk,nk->n", vectors, vectors)
    turns = np.sqrt(squares) / np.pi
    first, second = np.sinc(turns), 0.5 * np.sinc(0.5 * turns) ** 2
    turned: Real = (second[:, None] * vectors)[:, :, None] * vectors[:, None]
    turned += (1 - second * squares)[:, None, None] * _UNIT_MATRIX
    x, y, z = (first[:, None] * vectors).T
    turned[:, 0, 1] -= z
    turned[:, 1, 0] += z
    turned[:, 0, 2] += y
    turned[:, 2, 0] -= y
    turned[:, 1, 2] -= x
    turned[:, 2, 1] += x
    return turned


def compose_rotations(further: Real, before: Real) -> Real:
    """Compute the rotation vectors of one rotation after another, by unit quaternions; (n, 3).

    Args:
        further: rotation vectors of the second rotations [rad]; (n, 3).
        before: rotation vectors of the first rotations [rad]; (n, 3).

    Returns:
        Rotation vectors with angles up to pi.
    """
    (scalar, vector), (scalar_before, vector_before) = _quaternions(further), _quaternions(before)
    cosine = scalar * scalar_before - np.einsum("nk,nk->n", vector, vector_before)
    axis = scalar[:, None] * vector_before + scalar_before[:, None] * vector
    axis += cross_product(vector, vector_before)
    axis *= np.where(cosine < 0, -1.0, 1.0)[:, None]
    sine = np.sqrt(np.einsum("nk,nk->n", axis, axis))
    angle = 2 * np.arctan2(sine, np.abs(cosine))
    return np.asarray(
        axis * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 2.0)[:, None]
    )


def _quaternions(vectors: Real) -> tuple[Real, Real]:
    """Return scalar parts, (n,), and vector parts, (n, 3), of unit quaternions."""
    half = 0.5 * np.sqrt(np.einsum("nk,nk->n", vectors, vectors))
    return np.cos(half), (0.5 * np.sinc(half / np.pi))[:, None] * vectors
