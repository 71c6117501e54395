"""Small matrices of rigid-body motion: cross products, rotations, spatial inertia.

Motions and forces of a body have six entries, translation then rotation, in world axes.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import Real

_DEGENERATE = 1e-9  # principal moments closer than this, relative to the largest, count as equal


def cross_matrix(vector: Real) -> Real:
    """[v]x with [v]x w = v x w; (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(vector: Real) -> Real:
    """R = exp([v]x), the rotation by |v| [rad] about v; (3, 3)."""
    matrix: Real = Rotation.from_rotvec(vector).as_matrix()
    return matrix


def rotation_slopes(vector: Real) -> Real:
    r"""Derivatives of exp([v]x) by the entries of v; (3, 3, 3), the first axis over them.

    dR/dv_i = [J e_i]x R with the left Jacobian
    J = 1 + (1 - cos a)/a^2 [v]x + (a - sin a)/a^3 [v]x^2, a = |v| (Barfoot 2017, eq. 7.77).
    """
    angle = float(np.linalg.norm(vector))
    k = cross_matrix(vector)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    if angle < 1e-2:  # series: the next term is below 1e-16
        third = 1 / 6 - angle**2 / 120 + angle**4 / 5040
    else:
        third = (angle - np.sin(angle)) / angle**3
    jacobian = np.eye(3) + second * k + third * k @ k
    rotation = rotation_matrix(vector)
    return np.stack([cross_matrix(column) @ rotation for column in jacobian.T])


def transport(arm: Real) -> Real:
    """Motion at r + arm per motion at r of one body: v + w x arm, w; (6, 6)."""
    matrix = np.eye(6)
    matrix[:3, 3:] = -cross_matrix(arm)
    return matrix


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


def principal_inertia(inertia: Real) -> tuple[Real, Real]:
    """Principal moments and axes, each nearest to the world axis of its place.

    Where moments are equal the axes are free, and turned to the world's.

    Args:
        inertia: about the centre of mass [kg m^2]; (3, 3), symmetric.

    Returns:
        Moments [kg m^2]; (3,), and axes in columns; (3, 3).
    """
    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    near = _DEGENERATE * abs(moments[-1])
    if moments[2] - moments[0] <= near:
        axes = np.eye(3)
    elif moments[1] - moments[0] <= near or moments[2] - moments[1] <= near:
        single = 2 if moments[1] - moments[0] <= near else 0
        axis = axes[:, single]
        world = np.argsort(np.abs(axis))[:1]  # the world axis farthest from it
        first = np.eye(3)[:, world[0]] - axis * axis[world[0]]
        first /= np.linalg.norm(first)
        pair = [column for column in range(3) if column != single]
        axes = axes.copy()
        axes[:, pair[0]], axes[:, pair[1]] = first, np.cross(axis, first)
    return _nearest_order(moments, axes)


def _nearest_order(moments: Real, axes: Real) -> tuple[Real, Real]:
    orders = ([0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0])
    best = max(orders, key=lambda order: float(np.abs(np.diag(axes[:, order])).sum()))
    chosen = axes[:, best] * np.where(np.diag(axes[:, best]) < 0, -1.0, 1.0)
    return moments[best], chosen
