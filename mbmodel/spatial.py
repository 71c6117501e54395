"""Small matrices of rigid-body motion: cross products, rotations, spatial inertia.

Motions and forces of a body have six entries, translation then rotation, in world axes.
"""

import math

import numpy as np

from identification.words import Real

# Least second moment along an axis, as a share of the sum of all: keeps a body's mass from lying
# in a plane exactly, where its inertia would be singular.
_MIN_SECOND_MOMENT_SHARE = 1e-6


def cross_matrix(vector: Real) -> Real:
    """Return the cross-product matrix ``[v]x`` with ``[v]x w = v x w``; (3, 3).

    Args:
        vector: v; (3,).
    """
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(vector: Real) -> Real:
    """Return the rotation by ``|v|`` [rad] about v, ``R = exp([v]x)``; (3, 3).

    This is Rodrigues' formula (Barfoot 2017, eq. 7.11).

    Args:
        vector: rotation vector v [rad]; (3,).
    """
    angle, k = math.hypot(*vector), cross_matrix(vector)
    return np.eye(3) + _sine_ratio(angle) * k + _versine(angle) * (k @ k)


def _sine_ratio(angle: float) -> float:
    """Return ``sin(a) / a``, well defined at ``a = 0``."""
    return math.sin(angle) / angle if angle else 1.0


def _versine(angle: float) -> float:
    """Return ``(1 - cos a) / a^2``, well defined at ``a = 0``."""
    return 0.5 * _sine_ratio(angle / 2) ** 2


def rotation_slopes(vector: Real) -> Real:
    """Return the derivatives of ``exp([v]x)`` with respect to the entries of v; (3, 3, 3).

    ``dR/dv_i = [J e_i]x R`` with the left Jacobian of the rotation group,
    ``J = 1 + (1 - cos a)/a^2 [v]x + (a - sin a)/a^3 [v]x^2``, a = ``|v|`` (Barfoot 2017, eq. 7.77).

    Args:
        vector: rotation vector v [rad]; (3,).

    Returns:
        The first axis runs over the entries of v.
    """
    angle, k = math.hypot(*vector), cross_matrix(vector)
    if angle < 1e-2:  # series: the next term is below 1e-16
        third = 1 / 6 - angle**2 / 120 + angle**4 / 5040
    else:
        third = (angle - math.sin(angle)) / angle**3
    jacobian = np.eye(3) + _versine(angle) * k + third * (k @ k)
    rotation = rotation_matrix(vector)
    return np.stack([cross_matrix(column) @ rotation for column in jacobian.T])


def transport(arm: Real) -> Real:
    """Return the motion at ``r + arm`` per motion at r of one rigid body; (6, 6).

    The velocity becomes ``v + w x arm``, the rotation ``w`` stays.

    Args:
        arm: from the old to the new reference point [m]; (3,).
    """
    matrix = np.eye(6)
    matrix[:3, 3:] = -cross_matrix(arm)
    return matrix


def twist(turns: bool, arm: Real, axis: Real) -> Real:
    """Return the motion of a body per unit of a slide or hinge; (6,).

    A slide along a gives (a, 0), a hinge through p gives (p x a, a).

    Args:
        turns: whether the joint is a hinge.
        arm: p, from the reference point of the motion to the joint [m]; (3,).
        axis: a, unit vector; (3,).
    """
    if turns:
        return np.concatenate([cross_matrix(arm) @ axis, axis])
    return np.concatenate([axis, np.zeros(3)])


def spatial_inertia(mass: float, offset: Real, inertia: Real) -> Real:
    """Return the momentum of a body about a reference point per motion of it; (6, 6).

    For a centre of mass at d from the reference the matrix is
    ``[[m 1, -m [d]x], [m [d]x, I + m (d.d 1 - d d')]]``
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
    """Return mass, offset and inertia about the centre of mass of a spatial inertia.

    This inverts ``spatial_inertia``.

    Args:
        matrix: spatial inertia about a reference point; (6, 6).

    Returns:
        Mass [kg], centre of mass from the reference point [m] (3,), and inertia [kg m^2] (3, 3).
    """
    mass = float(matrix[0, 0])
    offset = np.array([matrix[5, 1], matrix[3, 2], matrix[4, 0]]) / mass
    k = cross_matrix(offset)
    return mass, offset, matrix[3:, 3:] + mass * k @ k


def nearest_inertia(inertia: Real) -> Real:
    """Return the physically consistent inertia nearest to a given one.

    The second moments ``J = sum over the mass of r r' = tr(I)/2 1 - I`` of a body have no
    eigenvalue below zero: ``J_i = (I_j + I_k - I_i) / 2 >= 0`` is the triangle inequality of its
    moments of inertia. With a mass above zero this is sufficient (Wensing, Kim, Slotine 2018).
    Eigenvalues below a millionth of the sum of the positive ones are raised to it:

        I = tr(J) 1 - J,   J_i >= 1e-6 sum of max(J_j, 0).

    This is the nearest in the Frobenius norm of J, with the centre of mass kept. A consistent
    inertia is returned unchanged.

    Args:
        inertia: I about the centre of mass [kg m^2]; (3, 3).
    """
    second, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    least = _MIN_SECOND_MOMENT_SHARE * float(np.maximum(second, 0.0).sum())
    if second[0] >= least:
        return inertia
    clipped: Real = (axes * np.maximum(second, least)) @ axes.T
    return np.trace(clipped) * np.eye(3) - clipped
