"""Static equilibrium, and the stiffness and damping there that no joint or tendon states."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import scipy.linalg

from identification.words import ConvergenceError, InputError, Real
from mbmodel.mjcf.read import active_constraint, joint_name

_STEP = 1e-6  # m or rad, or their rates; central differences of smooth forces
_ITERATIONS = 200
_HALVINGS = 30
_REACH = 0.3  # m or rad, longest step


@dataclass(frozen=True, eq=False)
class Rest:
    """A machine at rest.

    Args:
        data: after ``mj_forward`` at the static equilibrium.
        moved: displacement of each joint coordinate from the drawing [m, rad]; (nv,).
        stable: whether a small displacement meets no force that drives it on.
    """

    data: mujoco.MjData
    moved: Real
    stable: bool


def settle(model: mujoco.MjModel, path: Path) -> Rest:
    """Find the static equilibrium, downhill from the drawing.

    At rest the passive and actuator forces balance the bias: r(q) = qfrc_passive + qfrc_actuator
    - qfrc_bias = 0, with r' by central differences. Newton's step is taken in the modes of
    (-r', M) with the size of each stiffness (|k|, so that a pendulum drawn high falls instead of
    climbing), no further than ``_REACH`` and only as far as the forces do work; directions
    without stiffness and force stay. A drawing that is at rest already stays, stable or not.

    Args:
        model: the compiled model.
        path: of the MJCF, for messages.

    Returns:
        The machine at rest.

    Raises:
        InputError: a contact or limit is active there.
        ConvergenceError: forces that no displacement balances, as of a body in free fall.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scale = _force_scale(model, data)
    for _ in range(_ITERATIONS):
        residual = _force(model, data).copy()
        if np.abs(residual).max(initial=0.0) <= 1e-11 * scale:
            break
        step = _downhill(model, data, residual)
        if not _walk(model, data, residual, step):
            break
        if np.abs(step).max() < 1e-14:
            break
    if active := active_constraint(model, data):
        raise InputError(f"{path}: {active}")
    residual = _force(model, data)
    if np.abs(residual).max(initial=0.0) > 1e-6 * scale:
        joint = joint_name(model, model.dof_jntid[int(np.argmax(np.abs(residual)))])
        raise ConvergenceError(
            f"{path}: no static equilibrium found: joint {joint!r} is left with an unbalanced "
            "force; give it stiffness, turn gravity off, or draw the machine nearer to its rest"
        )
    moved = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, moved, 1.0, model.qpos0, data.qpos)
    return Rest(data, moved, _is_stable(model, data))


def _modes(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Real, Real]:
    """Stiffness and shapes of (-r', M), rotations of balls symmetrised."""
    stiffness = symmetrised(model, -_slope(model, data))
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    values, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    return values, shapes


def _is_stable(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    values, _ = _modes(model, data)
    return bool(values[0] >= -1e-9 * max(abs(values[-1]), abs(values[0])))


def _downhill(model: mujoco.MjModel, data: mujoco.MjData, residual: Real) -> Real:
    """A Newton step that never climbs, at most ``_REACH`` in any coordinate; (nv,)."""
    values, shapes = _modes(model, data)
    pull = shapes.T @ residual
    floor = 1e-13 * np.abs(values).max(initial=0.0)
    free = np.abs(values) <= floor
    amount = np.where(free, 0.0, pull / np.where(free, 1.0, np.abs(values)))
    if np.abs(pull[free]).max(initial=0.0) > 1e-9 * np.abs(pull).max():
        amount = np.where(free, np.sign(pull) * _REACH, amount)
    step: Real = shapes @ amount
    return step * min(1.0, _REACH / max(float(np.abs(step).max()), 1e-300))


def _walk(model: mujoco.MjModel, data: mujoco.MjData, residual: Real, step: Real) -> bool:
    """Go along a step, halved until the forces have done work on the way; whether it went."""
    start = data.qpos.copy()
    for _ in range(_HALVINGS):
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        mujoco.mj_forward(model, data)
        work = (residual + _force(model, data)) @ step
        size = np.linalg.norm(_force(model, data))
        if work > 0 or size < np.linalg.norm(residual):
            return True
        step = step / 2
    data.qpos[:] = start
    mujoco.mj_forward(model, data)
    return False


def symmetrised(model: mujoco.MjModel, matrix: Real) -> Real:
    """The same with the rotations of each ball and free joint made symmetric; (..., nv, nv).

    Their coordinates are the components of one rotation vector in axes that turn along, so that
    the derivative of a moment m holds [m]x / 2 beside the second derivative of the potential. At
    rest the moments of all forces cancel, so each may leave its own out.
    """
    result = matrix.copy()
    for joint in range(model.njnt):
        dofs = np.flatnonzero(model.dof_jntid == joint)[-3:]
        if len(dofs) == 3:
            own = matrix[..., dofs[:, None], dofs]
            result[..., dofs[:, None], dofs] = (own + np.swapaxes(own, -1, -2)) / 2
    return result


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
        stiffness = stiffness if velocity.any() else symmetrised(model, stiffness)
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
    return symmetrised(model, curvature)


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Elongation of each tendon per joint coordinate; (ntendon, nv)."""
    jacobian = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        start, count = model.ten_J_rowadr[tendon], model.ten_J_rownnz[tendon]
        columns = model.ten_J_colind[start : start + count]
        jacobian[tendon, columns] = data.ten_J[start : start + count]
    return jacobian
