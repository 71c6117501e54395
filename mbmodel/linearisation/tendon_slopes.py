"""Elongation of tendons at a pose, its slopes by the joint coordinates, and their slopes."""

import copy

import mujoco
import numpy as np

from identification.words import Real

# m or rad: of central differences of fourth order. The paths of tendons are smooth; rounding leaves
# 1e-11 of the curvature of a wire, whose own slopes by the pose are differences again.
_POSITION_STEP = 2e-5
# Of the values at these multiples of a step, over the step, in a first derivative.
FOURTH_ORDER_WEIGHTS = {2.0: -1 / 12, 1.0: 8 / 12, -1.0: -8 / 12, -2.0: 1 / 12}


def tendon_elongation(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return each tendon's length beyond its dead band [m], negative below it; (ntendon,)."""
    low, high = model.tendon_lengthspring.reshape(-1, 2).T
    length: Real = data.ten_length
    return np.where(length > high, length - high, np.minimum(length - low, 0.0))


def tendon_curvature(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the derivative of each tendon's Jacobian J by the joint coordinates.

    Under tension N a tendon adds the geometric stiffness ``N dJ/dq``. The derivative is a central
    difference; it is zero if no tendon is under tension.

    Returns:
        [1/m, 1]; (ntendon, nv, nv).
    """
    curvature = np.zeros((model.ntendon, model.nv, model.nv))
    if not np.any(tendon_elongation(model, data)):
        return curvature
    probe = copy.copy(data)
    for column in range(model.nv):
        for sign, weight in FOURTH_ORDER_WEIGHTS.items():
            direction = np.zeros(model.nv)
            direction[column] = sign * _POSITION_STEP
            probe.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, probe.qpos, direction, 1.0)
            mujoco.mj_fwdPosition(model, probe)
            curvature[:, :, column] += weight * tendon_jacobian(model, probe) / _POSITION_STEP
    return curvature


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the elongation of each tendon per joint coordinate; (ntendon, nv)."""
    jacobian = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        start, count = model.ten_J_rowadr[tendon], model.ten_J_rownnz[tendon]
        columns = model.ten_J_colind[start : start + count]
        jacobian[tendon, columns] = data.ten_J[start : start + count]
    return jacobian
