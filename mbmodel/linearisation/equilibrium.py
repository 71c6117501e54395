"""Static equilibrium, and the stiffness and damping there beyond linear springs and gravity."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
import scipy.linalg

from identification.words import ConvergenceError, InputError, Real
from mbmodel.mjcf.names import joint_name
from mbmodel.mjcf.refusals import active_constraint

# Step of central differences [m, rad, or their rates]: the forces are smooth, so that errors of
# truncation and of rounding are both small.
FORCE_DIFFERENCE_STEP = 1e-6
_MAX_NEWTON_STEPS = 200  # far more than Newton's method needs: it stops at rest
_MAX_STEP_HALVINGS = 30  # a step of 1e-9 of the first that does no work is given up
# Share of the mass that joints move one by one, below which a combination of them has none: the
# factorisation of the mass matrix loses all digits at 1e-16.
_MIN_MASS_SHARE = 1e-13
_MAX_STEP = 0.3  # m or rad: beyond it the linear prediction of forces means nothing


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A machine at rest.

    Args:
        data: after ``mj_forward`` at the static equilibrium.
        displacement: of each joint coordinate from the pose at the start [m, rad]; (nv,).
        stable: whether no small displacement meets a force that drives it on.
    """

    data: mujoco.MjData
    displacement: Real
    stable: bool


def find_equilibrium(model: mujoco.MjModel, path: Path, start: mujoco.MjData) -> Equilibrium:
    """Find the static equilibrium, downhill from a pose: the drawing or a keyframe.

    At rest the passive and actuator forces balance the bias: r(q) = qfrc_passive + qfrc_actuator
    - qfrc_bias = 0, with r' by central differences. Newton's step is taken in the modes of
    (-r', M) with the absolute value of each stiffness, so that a pendulum drawn upright falls
    instead of climbing. A step is no longer than ``_MAX_STEP`` and is halved until the forces do
    work along it. Directions without stiffness and force stay. A pose that is already at rest
    stays, stable or not.

    Args:
        model: the compiled model.
        path: of the MJCF, for messages.
        start: the pose, at rest, with the controls that stay.

    Returns:
        The machine at rest.

    Raises:
        InputError: a contact or limit is active there.
        ConvergenceError: forces that no displacement balances, such as those of a free fall.
    """
    data = copy.copy(start)
    mujoco.mj_forward(model, data)
    _refuse_singular_mass(model, data, path)
    scale = force_scale(model, data)
    for _ in range(_MAX_NEWTON_STEPS):
        residual = _net_force(model, data).copy()
        if np.abs(residual).max(initial=0.0) <= 1e-11 * scale:
            break
        step = _downhill_step(model, data, residual)
        if not _try_step(model, data, residual, step):
            break
        if np.abs(step).max() < 1e-14:
            break
    if active := active_constraint(model, data):
        raise InputError(f"{path}: {active}")
    residual = _net_force(model, data)
    if np.abs(residual).max(initial=0.0) > 1e-6 * scale:
        joint = joint_name(model, model.dof_jntid[int(np.argmax(np.abs(residual)))])
        raise ConvergenceError(
            f"{path}: no static equilibrium found, because the force at joint {joint!r} stays "
            "unbalanced: give it stiffness, turn gravity off, or draw the machine nearer to rest"
        )
    displacement = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, displacement, 1.0, start.qpos, data.qpos)
    return Equilibrium(data, displacement, _is_stable(model, data))


def _refuse_singular_mass(model: mujoco.MjModel, data: mujoco.MjData, path: Path) -> None:
    """Refuse a machine with a motion that moves next to no mass, beside what each joint moves.

    The mass matrix is scaled to a diagonal of ones, so that units do not count. Its smallest
    eigenvalue is the mass of the lightest combination of joints.
    """
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    scale = np.sqrt(np.diag(mass))
    if np.isfinite(mass).all() and scale.min(initial=1.0) > 0:
        values, vectors = scipy.linalg.eigh(mass / np.outer(scale, scale))
        if values.min(initial=1.0) > _MIN_MASS_SHARE:
            return
        place = int(np.argmax(np.abs(vectors[:, 0])))
    else:
        place = int(np.argmin(np.where(np.isfinite(scale), scale, -1.0)))
    joint = joint_name(model, model.dof_jntid[place])
    raise InputError(
        f"{path}: joint {joint!r} moves together with others without moving any mass: two joints "
        "have nearly one axis, or a length, mass or inertia is out of scale; correct it"
    )


def _tangent_modes(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Real, Real]:
    """Return stiffnesses and shapes of (-r', M), with rotations of balls symmetrised."""
    stiffness = symmetrise_rotations(model, -_force_slope(model, data))
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    values, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    return values, shapes


def _is_stable(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Return whether the tangent stiffness has no eigenvalue below zero, but for rounding."""
    values, _ = _tangent_modes(model, data)
    return bool(values[0] >= -1e-9 * max(abs(values[-1]), abs(values[0])))


def _downhill_step(model: mujoco.MjModel, data: mujoco.MjData, residual: Real) -> Real:
    """Return a Newton step that never climbs, at most ``_MAX_STEP`` in any coordinate; (nv,)."""
    values, shapes = _tangent_modes(model, data)
    pull = shapes.T @ residual
    floor = 1e-13 * np.abs(values).max(initial=0.0)
    free = np.abs(values) <= floor
    amount = np.where(free, 0.0, pull / np.where(free, 1.0, np.abs(values)))
    if np.abs(pull[free]).max(initial=0.0) > 1e-9 * np.abs(pull).max():
        amount = np.where(free, np.sign(pull) * _MAX_STEP, amount)
    step: Real = shapes @ amount
    return step * min(1.0, _MAX_STEP / max(float(np.abs(step).max()), 1e-300))


def _try_step(model: mujoco.MjModel, data: mujoco.MjData, residual: Real, step: Real) -> bool:
    """Go along a step, halved until the forces do work on the way; return whether it went."""
    start = data.qpos.copy()
    for _ in range(_MAX_STEP_HALVINGS):
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        mujoco.mj_forward(model, data)
        work = (residual + _net_force(model, data)) @ step
        size = np.linalg.norm(_net_force(model, data))
        if work > 0 or size < np.linalg.norm(residual):
            return True
        step = step / 2
    data.qpos[:] = start
    mujoco.mj_forward(model, data)
    return False


def symmetrise_rotations(model: mujoco.MjModel, matrix: Real) -> Real:
    """Return a matrix whose blocks of ball and free joints' rotations are symmetric; (..., nv, nv).

    The coordinates of such a rotation are the components of one rotation vector in axes that turn
    along. The derivative of a moment m then holds ``[m]x / 2`` beside the second derivative of the
    potential. At rest the moments of all forces cancel, so each force may omit its own part.

    Args:
        model: the compiled model.
        matrix: derivatives of generalised forces by joint coordinates; (..., nv, nv).
    """
    result = matrix.copy()
    for joint in range(model.njnt):
        dofs = np.flatnonzero(model.dof_jntid == joint)[-3:]
        if len(dofs) == 3:
            block = matrix[..., dofs[:, None], dofs]
            result[..., dofs[:, None], dofs] = (block + np.swapaxes(block, -1, -2)) / 2
    return result


def _net_force(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the generalised force r that vanishes at rest; (nv,)."""
    force: Real = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
    return force


def force_scale(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the size of the forces that have to balance: the largest of weight, tension, net."""
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    tension = np.abs(model.tendon_stiffness * tendon_elongation(model, data))
    pull = (tension[:, None] * np.abs(tendon_jacobian(model, data))).max(initial=0.0)
    net = np.abs(_net_force(model, data)).max(initial=0.0)
    return max(weight, float(pull), float(net), 1e-300)


def _force_slope(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the derivative of the force by the displacement; (nv, nv)."""
    return -force_slopes(model, data, along="position")[0]


def force_slopes(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    along: Literal["position", "velocity"],
    velocity: Real | None = None,
    step: float = FORCE_DIFFERENCE_STEP,
) -> tuple[Real, Real]:
    """Return minus the central differences of the force, and how far they differ between sides.

    Args:
        model: the compiled model.
        data: at static equilibrium.
        along: ``position`` for the stiffness, ``velocity`` for the damping.
        velocity: of the joint coordinates in steady motion; None at rest; (nv,).
        step: of the differences [m, rad, or their rates].

    Returns:
        Stiffness or damping, column j along coordinate j, and the slope to one side minus that to
        the other, which is of the size of the step where the force is smooth; (nv, nv) each.
    """
    probe = copy.copy(data)
    slope, kink = np.empty((model.nv, model.nv)), np.empty((model.nv, model.nv))
    steady = np.zeros(model.nv) if velocity is None else velocity
    middle = None
    for column in range(model.nv):
        forces = []
        for sign in (1.0, -1.0) if middle is not None else (1.0, -1.0, 0.0):
            direction = np.zeros(model.nv)
            direction[column] = sign * step
            probe.qpos[:], probe.qvel[:] = data.qpos, steady
            if along == "position":
                mujoco.mj_integratePos(model, probe.qpos, direction, 1.0)
            else:
                probe.qvel[:] += direction
            mujoco.mj_fwdPosition(model, probe)
            mujoco.mj_fwdVelocity(model, probe)
            mujoco.mj_fwdActuation(model, probe)
            forces.append(_net_force(model, probe).copy())
        middle = forces.pop() if middle is None else middle
        slope[:, column] = -(forces[0] - forces[1]) / (2 * step)
        kink[:, column] = (forces[0] - 2 * middle + forces[1]) / step
    return slope, kink


def remaining_stiffness_and_damping(
    model: mujoco.MjModel, data: mujoco.MjData, velocity: Real
) -> tuple[Real, Real]:
    """Return stiffness and damping beside gravity and the linear springs of joints and tendons.

    They are those of actuators, polynomial terms and the gyroscopic and centrifugal forces of
    steady motion. They are central differences of the forces, with gravity and the linear joint
    and tendon coefficients set to zero. So a machine without such effects gets exact zeros instead
    of rounding noise of its stiff springs. The part of tendon tension is ``tendon_curvature``.

    Args:
        model: the compiled model; left as it was.
        data: at the static equilibrium.
        velocity: of the joint coordinates in steady motion [m/s, rad/s]; (nv,).

    Returns:
        K [N/m, N m/rad] and C [N s/m, N m s/rad]; (nv, nv) each.
    """
    zeroed = ("jnt_stiffness", "dof_damping", "tendon_stiffness", "tendon_damping")
    original = {name: getattr(model, name).copy() for name in zeroed}
    gravity = model.opt.gravity.copy()
    try:
        for name in zeroed:
            getattr(model, name)[:] = 0.0
        model.opt.gravity[:] = 0.0
        stiffness, _ = force_slopes(model, data, along="position", velocity=velocity)
        stiffness = stiffness if velocity.any() else symmetrise_rotations(model, stiffness)
        damping, _ = force_slopes(model, data, along="velocity", velocity=velocity)
    finally:
        model.opt.gravity[:] = gravity
        for name, value in original.items():
            getattr(model, name)[:] = value
    return stiffness, damping


def tendon_elongation(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return each tendon's length beyond its dead band [m], negative below it; (ntendon,)."""
    low, high = model.tendon_lengthspring.reshape(-1, 2).T
    length: Real = data.ten_length
    beyond: Real = np.where(length > high, length - high, np.minimum(length - low, 0.0))
    return beyond


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
        for sign in (1.0, -1.0):
            direction = np.zeros(model.nv)
            direction[column] = sign * FORCE_DIFFERENCE_STEP
            probe.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, probe.qpos, direction, 1.0)
            mujoco.mj_fwdPosition(model, probe)
            curvature[:, :, column] += (
                sign * tendon_jacobian(model, probe) / (2 * FORCE_DIFFERENCE_STEP)
            )
    return symmetrise_rotations(model, curvature)


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the elongation of each tendon per joint coordinate; (ntendon, nv)."""
    jacobian = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        start, count = model.ten_J_rowadr[tendon], model.ten_J_rownnz[tendon]
        columns = model.ten_J_colind[start : start + count]
        jacobian[tendon, columns] = data.ten_J[start : start + count]
    return jacobian
