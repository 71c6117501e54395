"""Static equilibrium, and the stiffness and damping there that no joint or tendon states."""

from pathlib import Path

import mujoco
import numpy as np

from identification.words import ConvergenceError, InputError, Real
from mbmodel.mjcf import active_constraint, joint_name

_STEP = 1e-6  # m or rad, or their rates; central differences of smooth forces
_ITERATIONS = 50


def settle(model: mujoco.MjModel, path: Path) -> mujoco.MjData:
    """Find the static equilibrium by Newton's method on the generalised forces.

    At rest the passive and actuator forces balance the bias: r(q) = qfrc_passive + qfrc_actuator
    - qfrc_bias = 0, with r' by central differences; directions without stiffness (r' singular)
    do not move, since a minimum-norm step leaves them alone. The start is ``qpos0``.

    Args:
        model: the compiled model.
        path: of the MJCF, for messages.

    Returns:
        Data at the equilibrium, after ``mj_forward``.

    Raises:
        InputError: a contact or limit is active there.
        ConvergenceError: forces that no displacement balances, as of a body in free fall.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scale = _force_scale(model, data)
    for _ in range(_ITERATIONS):
        residual = _force(model, data)
        if np.abs(residual).max(initial=0.0) <= 1e-11 * scale:
            break
        step = np.linalg.lstsq(-_slope(model, data), residual, rcond=1e-13)[0]
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        mujoco.mj_forward(model, data)
        if np.abs(step).max() < 1e-14 and np.abs(residual).max() <= 1e-6 * scale:
            break
    else:
        if active := active_constraint(model, data):
            raise InputError(f"{path}: {active}")
        worst = int(np.argmax(np.abs(_force(model, data))))
        joint = joint_name(model, model.dof_jntid[worst])
        raise ConvergenceError(
            f"{path}: no static equilibrium: joint {joint!r} is left with an unbalanced force; "
            "give it stiffness, or turn gravity off"
        )
    if active := active_constraint(model, data):
        raise InputError(f"{path}: {active}")
    return data


def _force(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    force: Real = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
    return force


def _force_scale(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Size of the forces that have to balance, each by itself."""
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    tension = np.abs(model.tendon_stiffness * elongation(model, data))
    pull = (tension[:, None] * np.abs(tendon_jacobian(model, data))).max(initial=0.0)
    net = np.abs(_force(model, data)).max(initial=0.0)
    return max(weight, float(pull), float(net), 1e-300)


def _slope(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Derivative of the force by the displacement; (nv, nv)."""
    return _differences(model, data, along="position")


def _differences(
    model: mujoco.MjModel, data: mujoco.MjData, along: str, velocity: Real | None = None
) -> Real:
    """Central differences of the smooth generalised force; column j: along coordinate j."""
    probe = mujoco.MjData(model)
    slope = np.empty((model.nv, model.nv))
    steady = np.zeros(model.nv) if velocity is None else velocity
    for column in range(model.nv):
        forces = []
        for sign in (1.0, -1.0):
            direction = np.zeros(model.nv)
            direction[column] = sign * _STEP
            probe.qpos[:], probe.qvel[:] = data.qpos, steady
            if along == "position":
                mujoco.mj_integratePos(model, probe.qpos, direction, 1.0)
            else:
                probe.qvel[:] += direction
            mujoco.mj_fwdPosition(model, probe)
            mujoco.mj_fwdVelocity(model, probe)
            mujoco.mj_fwdActuation(model, probe)
            forces.append(_force(model, probe).copy())
        slope[:, column] = (forces[0] - forces[1]) / (2 * _STEP)
    return slope


def remaining_stiffness_and_damping(
    model: mujoco.MjModel, data: mujoco.MjData, velocity: Real
) -> tuple[Real, Real]:
    """Stiffness and damping beside gravity and the linear springs of joints and tendons.

    Actuators, polynomial terms and the gyroscopic and centrifugal forces of steady motion, by
    central differences of the forces with gravity and the linear joint and tendon coefficients
    set to zero: so a machine without such effects gets exact zeros instead of rounding noise of
    its stiff springs. What the tension of tendons adds is ``tendon_curvature``.

    Args:
        model: the compiled model; left as it was.
        data: at the static equilibrium.
        velocity: of the joint coordinates in steady motion [m/s, rad/s]; (nv,).

    Returns:
        K [N/m, N m/rad] and C [N s/m, N m s/rad]; (nv, nv) each.
    """
    stated = ("jnt_stiffness", "dof_damping", "tendon_stiffness", "tendon_damping")
    kept = {name: getattr(model, name).copy() for name in stated}
    gravity = model.opt.gravity.copy()
    try:
        for name in stated:
            getattr(model, name)[:] = 0.0
        model.opt.gravity[:] = 0.0
        stiffness = -_differences(model, data, along="position", velocity=velocity)
        damping = -_differences(model, data, along="velocity", velocity=velocity)
    finally:
        model.opt.gravity[:] = gravity
        for name, value in kept.items():
            getattr(model, name)[:] = value
    return stiffness, damping


def elongation(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Length beyond the dead band ``tendon_lengthspring``; negative below it."""
    low, high = model.tendon_lengthspring.reshape(-1, 2).T
    length: Real = data.ten_length
    beyond: Real = np.where(length > high, length - high, np.minimum(length - low, 0.0))
    return beyond


def tendon_curvature(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Derivative of each tendon's Jacobian by the joint coordinates; (ntendon, nv, nv).

    Under tension N a tendon adds the geometric stiffness N dJ/dq.
    """
    curvature = np.zeros((model.ntendon, model.nv, model.nv))
    if not np.any(elongation(model, data)):
        return curvature
    probe = mujoco.MjData(model)
    for column in range(model.nv):
        for sign in (1.0, -1.0):
            direction = np.zeros(model.nv)
            direction[column] = sign * _STEP
            probe.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, probe.qpos, direction, 1.0)
            mujoco.mj_fwdPosition(model, probe)
            curvature[:, :, column] += sign * tendon_jacobian(model, probe) / (2 * _STEP)
    return curvature


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Elongation of each tendon per joint coordinate; (ntendon, nv)."""
    jacobian = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        start, count = model.ten_J_rowadr[tendon], model.ten_J_rownnz[tendon]
        columns = model.ten_J_colind[start : start + count]
        jacobian[tendon, columns] = data.ten_J[start : start + count]
    return jacobian
