"""Masses of an appendage along the axes: its rigid part, and the axis of a single one.

``theta`` holds the parameters of ``appendage_part.py``: the masses, in units of mass, at 0 to 2,
and the shares ``across`` and ``counted`` at 8 and 9.
"""

import numpy as np

from diagnosis.effects.scales import MASS_SHARE_UNIT
from identification.words import Mask, Real


def find_rigid_masses(theta: Real) -> Real:
    """Return r_a = across (M - m_a) - counted M, in units of mass; (3,)."""
    largest, (across, counted) = theta[:3].max(), theta[8:]
    return across * (largest - theta[:3]) - counted * largest


def find_rigid_slopes(theta: Real) -> Real:
    """Return the slopes of the rigid masses by all parameters; (3, n_parameter)."""
    largest, (across, counted) = theta[:3].max(), theta[8:]
    slopes = np.zeros((3, len(theta)))
    slopes[:, :3] = -across * np.eye(3)
    if largest > 0:
        slopes[:, np.argmax(theta[:3])] += across - counted
    else:
        slopes[:, :3] += across - counted  # beside no other mass, each is the largest
    slopes[:, 8] = largest - theta[:3]
    slopes[:, 9] = -largest
    return slopes


def find_single_axis(masses: Real) -> Mask:
    """Return which axis is the only one along which the appendage moves, if there is one; (3,).

    FRFs are equal wherever the appendage lies along that axis: the nearest place is stated. Masses
    within one unit of zero do not count.
    """
    is_large: Mask = masses > MASS_SHARE_UNIT * masses.max()
    return is_large if is_large.sum() == 1 else np.zeros(3, bool)
