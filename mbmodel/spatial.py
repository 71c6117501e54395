"""Small matrices of rigid-body motion: cross products, rotations, spatial inertia.

Motions and forces of a body have six entries, translation then rotation, in world axes.
"""

import numpy as np

from identification.words import Real

_THIN = 1e-6  # of all second moments: the least that a body has along an axis


def cross_matrix(vector: Real) -> Real:
    """[v]x with [v]x w = v x w; (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(vector: Real) -> Real:
    """R = exp([v]x), the rotation by |v| [rad] about v; (3, 3) (Barfoot 2017, eq. 7.11)."""
    angle = float(np.linalg.norm(vector))
    k = cross_matrix(vector)
    matrix: Real = np.eye(3) + float(np.sinc(angle / np.pi)) * k + _versine(angle) * k @ k
    return matrix


def _versine(angle: float) -> float:
    """(1 - cos a) / a^2."""
    return float(0.5 * np.sinc(angle / (2 * np.pi)) ** 2)


def rotation_slopes(vector: Real) -> Real:
    r"""Derivatives of exp([v]x) by the entries of v; (3, 3, 3), the first axis over them.

    dR/dv_i = [J e_i]x R with the left Jacobian
    J = 1 + (1 - cos a)/a^2 [v]x + (a - sin a)/a^3 [v]x^2, a = |v| (Barfoot 2017, eq. 7.77).
    """
    angle = float(np.linalg.norm(vector))
    k = cross_matrix(vector)
    if angle < 1e-2:  # series: the next term is below 1e-16
        third = 1 / 6 - angle**2 / 120 + angle**4 / 5040
    else:
        third = (angle - np.sin(angle)) / angle**3
    jacobian = np.eye(3) + _versine(angle) * k + third * k @ k
    rotation = rotation_matrix(vector)
    return np.stack([cross_matrix(column) @ rotation for column in jacobian.T])


def transport(arm: Real) -> Real:
    """Motion at r + arm per motion at r of one body: v + w x arm, w; (6, 6)."""
    matrix = np.eye(6)
    matrix[:3, 3:] = -cross_matrix(arm)
    return matrix


def twist(turns: bool, arm: Real, axis: Real) -> Real:
    """Motion of a body at the origin of ``arm`` per unit of a slide or hinge; (6,).

    (a, 0) of a slide along a, (p x a, a) of a hinge through p.
    """
    if turns:
        return np.concatenate([cross_matrix(arm) @ axis, axis])
    return np.concatenate([axis, np.zeros(3)])


def spatial_inertia(mass: float, offset: Real, inertia: Real) -> Real:
    """Momentum about a reference point per motion of it; (6, 6).

    [[m 1, -m [d]x], [m [d]x, I + m (d.d 1 - d d')]] for a centre of mass at d from the reference
    (Featherstone 2008, eq. 2.63, translation first).

    Args:
        mass: m [kg].
        offset: d [m]; (3,).
        inertia: I about the centre of mass [kg m^2]; (3, 3).
    """
    k = cross_matrix(offset)
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = mass * np.eye(3)
    matrix[:3, 3:] = -mass * k
    matrix[3:, :3] = mass * k
    matrix[3:, 3:] = inertia - mass * k @ k
    return matrix


def split_inertia(matrix: Real) -> tuple[float, Real, Real]:
    """Mass, offset and inertia about the centre of mass of a spatial inertia."""
    mass = float(matrix[0, 0])
    offset = np.array([matrix[5, 1], matrix[3, 2], matrix[4, 0]]) / mass
    k = cross_matrix(offset)
    return mass, offset, matrix[3:, 3:] + mass * k @ k


def nearest_inertia(inertia: Real) -> Real:
    r"""The inertia nearest to one that no body may have, about the same centre of mass.

    A body's second moments J = sum over its mass of r r' = tr(I)/2 1 - I have no eigenvalue below
    zero: J_i = (I_j + I_k - I_i) / 2 is the triangle inequality of its moments of inertia. With a
    mass above zero that is all that a body asks for (Wensing, Kim, Slotine 2018). Here

        I = tr(J) 1 - J,   J_i at least a millionth of the sum of those above zero,

    the nearest by the sum of squares of the entries of J; what a body may have stays as it is.

    Args:
        inertia: I about the centre of mass [kg m^2]; (3, 3).
    """
    second, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    least = _THIN * float(np.maximum(second, 0.0).sum())
    if second[0] >= least:
        return inertia
    kept: Real = (axes * np.maximum(second, least)) @ axes.T
    found: Real = np.trace(kept) * np.eye(3) - kept
    return found
