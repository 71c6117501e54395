"""Geometric stiffness of gravity at a fixed pose, and its derivatives.

The potential of bodies with spatial inertia Mb under gravity g is V = -sum_b g.(m_b c_b). For joint
coordinates i before j on one chain, i turns what j moves about its axis. The second derivative is
K_ij = -sum_b g.(w_bi x p_bj), with w the rotation of body b per coordinate i and p the linear
momentum of body b per velocity of j, the upper three rows of Mb T (Featherstone 2008, ch. 7, for
the momenta). With the block-diagonal X of [[0, 0], [-[g]x, 0]],

    U = -T' X Mb T,   K = N o U + (N o U)',

N the precedence: 1 for i before j, 1/2 where i = j (o: entry by entry). Each body may have axes of
its own, in which its motions, inertia and gravity are given.

The coordinates of a closed chain act at once, N = 1/2, and bend the paths of the bodies beyond
that: with B the second derivative of their motion, K_ij gains -sum_b g.(Mb B_ij)_b.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from identification.words import Real
from mbmodel.spatial import cross_matrix


@lru_cache(maxsize=16)
def _gravity_cross(gravity: tuple[tuple[float, ...], ...]) -> Real:
    """Return X; (6 n_body, 6 n_body)."""
    n_body = len(gravity)
    matrix = np.zeros((6 * n_body, 6 * n_body))
    for body in range(n_body):
        matrix[6 * body + 3 : 6 * body + 6, 6 * body : 6 * body + 3] = -cross_matrix(
            np.array(gravity[body])
        )
    return matrix


@dataclass(frozen=True, eq=False)
class Weight:
    """Gravity, and how coordinates turn what others move.

    Args:
        gravity: in the axes of each body [m/s^2]; (n_body, 3).
        precedence: N; (nv, nv).
        curvature: B, second derivative of the motion of the centres of mass beyond N; None for a
            machine without closed chains; (6 n_body, nv, nv).
    """

    gravity: Real
    precedence: Real
    curvature: Real | None = None

    @property
    def cross(self) -> Real:
        """X; (6 n_body, 6 n_body)."""
        return _gravity_cross(tuple(map(tuple, self.gravity.tolist())))

    @property
    def acceleration(self) -> Real:
        """Gravity in the rows of body motions; (6 n_body,)."""
        return np.pad(self.gravity, ((0, 0), (0, 3))).ravel()

    def bend(self, inertia: Real) -> Real | float:
        """Return the stiffness of weight on curved paths; (nv, nv)."""
        if self.curvature is None:
            return 0.0
        return -np.tensordot(self.acceleration @ inertia, self.curvature, 1)


def _symmetrise(mask: Real, half: Real) -> Real:
    """Return ``N o U + (N o U)'``."""
    masked = mask * half
    return masked + masked.T


def gravity_stiffness(weight: Weight, jacobian: Real, inertia: Real) -> Real:
    """Return the stiffness of gravity in joint coordinates.

    Args:
        weight: gravity of the machine.
        jacobian: T; (6 n_body, nv).
        inertia: Mb, its rows times each body's weight fraction; (6 n_body, 6 n_body).

    Returns:
        K [N/m, N m/rad]; (nv, nv), symmetric.
    """
    half = -jacobian.T @ weight.cross @ inertia @ jacobian
    return _symmetrise(weight.precedence, half) + weight.bend(inertia)


def gravity_slope(
    weight: Weight,
    jacobian: Real,
    inertia: Real,
    *,
    jacobian_change: Real | None = None,
    inertia_change: Real | None = None,
) -> Real:
    """Return the change of K for small changes of T and Mb; (nv, nv).

    B stays: where joints move, the weight on curved paths of a closed chain keeps their curvature.

    Args:
        weight, jacobian (6 n_body, nv), inertia (6 n_body, 6 n_body): as for
            ``gravity_stiffness``.
        jacobian_change: dT; (6 n_body, nv).
        inertia_change: change of ``inertia``; (6 n_body, 6 n_body).
    """
    cross = weight.cross
    half = np.zeros((jacobian.shape[1],) * 2)
    if jacobian_change is not None:
        half -= jacobian_change.T @ cross @ inertia @ jacobian
        half -= jacobian.T @ cross @ inertia @ jacobian_change
    if inertia_change is not None:
        half -= jacobian.T @ cross @ inertia_change @ jacobian
    bent = 0.0 if inertia_change is None else weight.bend(inertia_change)
    return _symmetrise(weight.precedence, half) + bent


def gravity_adjoint(
    weight: Weight, jacobian: Real, inertia: Real, cotangent: Real
) -> tuple[Real, Real]:
    """Return the derivatives of <S, K> by T and by Mb; (6 n_body, nv) and (6 n_body, 6 n_body).

    Args:
        weight, jacobian (6 n_body, nv), inertia (6 n_body, 6 n_body): as for
            ``gravity_stiffness``.
        cotangent: S; (nv, nv).
    """
    cross = weight.cross
    shares = weight.precedence * (cotangent + cotangent.T)
    cross_inertia = cross @ inertia
    by_jacobian = -(cross_inertia @ jacobian @ shares.T + cross_inertia.T @ jacobian @ shares)
    by_inertia = -cross.T @ jacobian @ shares @ jacobian.T
    if weight.curvature is not None:
        by_inertia -= np.outer(weight.acceleration, np.tensordot(weight.curvature, cotangent, 2))
    return by_jacobian, by_inertia
