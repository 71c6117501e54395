"""Rows of a rig by which effects act: motion of bodies, stretch of joints, in all coordinates.

Effects that came before may have coordinates of their own at the end of the rig's; the rows here
are as wide as the rig, zero there.
"""

import numpy as np

from truth.machine.dynamics import joint_rows, motion_at
from truth.machine.rig import Prepared, Rig
from truth.machine.station import GROUND, Real


def body_motion(rig: Rig, tested: Prepared, index: int, point: Real) -> Real:
    """Return translation of a stage's point and its rotation there, world axes; (6, n)."""
    return _as_wide(motion_at(tested.station, index, point, tested.flexes), rig)


def relative_motion(rig: Rig, tested: Prepared, index: int, point: Real) -> Real:
    """Return the motion at a point of a stage against its parent, world axes; (6, n)."""
    motion = body_motion(rig, tested, index, point)
    parent = tested.station.stages[index].parent
    return motion if parent == GROUND else motion - body_motion(rig, tested, parent, point)


def joint_stretch(rig: Rig, tested: Prepared, index: int) -> Real:
    """Return how far each joint of a stage moves; (n_joint, n)."""
    return _as_wide(joint_rows(tested.station, index, tested.flexes)[0], rig)


def springs(rows: Real, stiffness: Real | list[float]) -> Real:
    """Return the stiffness matrix of springs on rows, sum of k g g^T; (n, n)."""
    matrix: Real = (rows.T * stiffness) @ rows
    return matrix


def _as_wide(rows: Real, rig: Rig) -> Real:
    return np.pad(rows, ((0, 0), (0, len(rig.equations.mass) - rows.shape[1])))
