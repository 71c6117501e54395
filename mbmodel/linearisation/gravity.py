r"""Geometric stiffness of gravity at a fixed pose, and its derivatives.

The potential of bodies with spatial inertia Mb under gravity g is V = -sum_b g.(m_b c_b). Its
second derivative by joint coordinates i before j on one chain turns what j moves about the axis of
i: K_ij = -sum_b g.(w_bi x p_bj) with w the rotation of body b per coordinate i and p the linear
momentum of body b per velocity of j, the upper three rows of Mb T (Featherstone 2008, ch. 7, for
the momenta). With the block-diagonal X of [[0, 0], [-[g]x, 0]],

    U = -T' X Mb T,   K = N o U + (N o U)',

N the mask of i before j, with a half where i = j (o: entry by entry). A sag, the displacement at
which all forces balance, is not part of this: the pose at rest stays that of the drawing.
"""

from functools import lru_cache

import numpy as np

from identification.words import Real
from mbmodel.spatial import cross_matrix


@lru_cache(maxsize=16)
def _turning(gravity: tuple[float, ...], n_body: int) -> Real:
    """X; (6 n_body, 6 n_body)."""
    matrix = np.zeros((6 * n_body, 6 * n_body))
    for body in range(n_body):
        matrix[6 * body + 3 : 6 * body + 6, 6 * body : 6 * body + 3] = -cross_matrix(
            np.array(gravity)
        )
    return matrix


def _symmetric(mask: Real, half: Real) -> Real:
    masked = mask * half
    total: Real = masked + masked.T
    return total


def gravity_stiffness(gravity: Real, order: Real, jacobian: Real, inertia: Real) -> Real:
    """K of gravity in joint coordinates.

    Args:
        gravity: [m/s^2]; (3,).
        order: N; (nv, nv).
        jacobian: T; (6 n_body, nv).
        inertia: Mb, its rows times the share of each body's weight; (6 n_body, 6 n_body).

    Returns:
        [N/m, N m/rad]; (nv, nv), symmetric.
    """
    turning = _turning(tuple(gravity), len(jacobian) // 6)
    return _symmetric(order, -jacobian.T @ turning @ inertia @ jacobian)


def gravity_slope(  # one argument for each factor of U and its change
    gravity: Real,
    order: Real,
    jacobian: Real,
    inertia: Real,
    *,
    jacobian_change: Real | None = None,
    inertia_change: Real | None = None,
) -> Real:
    """Change of K for small changes of T and Mb; (nv, nv)."""
    turning = _turning(tuple(gravity), len(jacobian) // 6)
    half = np.zeros((jacobian.shape[1],) * 2)
    if jacobian_change is not None:
        half -= jacobian_change.T @ turning @ inertia @ jacobian
        half -= jacobian.T @ turning @ inertia @ jacobian_change
    if inertia_change is not None:
        half -= jacobian.T @ turning @ inertia_change @ jacobian
    return _symmetric(order, half)


def gravity_adjoint(
    gravity: Real, order: Real, jacobian: Real, inertia: Real, cotangent: Real
) -> tuple[Real, Real]:
    """Derivatives of <S, K> by T and by Mb, S the cotangent; (6 n_body, nv), (6 n_body,) * 2."""
    turning = _turning(tuple(gravity), len(jacobian) // 6)
    weight = order * (cotangent + cotangent.T)
    pressed = turning @ inertia
    by_jacobian = -(pressed @ jacobian @ weight.T + pressed.T @ jacobian @ weight)
    by_inertia = -turning.T @ jacobian @ weight @ jacobian.T
    return by_jacobian, by_inertia
