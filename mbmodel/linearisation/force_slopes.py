"""Slopes of a machine's forces by position and velocity, as differences of MuJoCo's own forces."""

import copy
from collections.abc import Callable, Container
from typing import Literal

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.linearisation.chain_closure import dense_rows
from mbmodel.linearisation.tendon_slopes import tendon_elongation, tendon_jacobian

# Step of central differences [m, rad, or their rates]: the forces are smooth, so that errors of
# truncation and of rounding are both small.
FORCE_DIFFERENCE_STEP = 1e-6
_MIN_DIFFERENCE_STEP = 1e-11  # below it rounding takes over
_STEP_OF_DISTANCE = 0.05  # of the way to the end of a dead band, so that ten steps stay inside
_LENGTH_SHARE = 1e-8  # of the machine's size: the elongation of a tendon that force_scale counts
_MAX_CUBIC_SHARE = 1e-6  # of the slope, that a cubic term adds to a difference
_POSITION_STEPS = (
    mujoco.mj_kinematics,
    mujoco.mj_comPos,
    mujoco.mj_camlight,
    mujoco.mj_flex,
    mujoco.mj_tendon,
    mujoco.mj_makeM,
    mujoco.mj_collision,
    mujoco.mj_makeConstraint,
    mujoco.mj_transmission,
)


def choose_difference_step(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return a step within which a machine's forces are as at rest [m or rad].

    It is 1e-6, or less within a narrow dead band, or beside a steep cubic spring: its central
    difference is k + k3 h^2.
    """
    steps = [FORCE_DIFFERENCE_STEP]
    rows = tendon_jacobian(model, data)
    for tendon in np.flatnonzero(model.tendon_stiffness > 0):
        low, high = model.tendon_lengthspring[tendon]
        length, reach = data.ten_length[tendon], np.abs(rows[tendon]).max(initial=0.0)
        if high > low and reach > 0:
            distance = min(abs(length - low), abs(length - high))
            # Closer to an end than this, the rest itself is the kink that is looked for.
            is_apart = distance > _MIN_DIFFERENCE_STEP / _STEP_OF_DISTANCE
            steps += [_STEP_OF_DISTANCE * distance / reach] if is_apart else []
    for k, (_, cubic) in zip(model.jnt_stiffness, model.jnt_stiffnesspoly[:, :2], strict=True):
        if k > 0 and cubic:
            steps.append(float(np.sqrt(_MAX_CUBIC_SHARE * k / abs(cubic))))
    return max(min(steps), _MIN_DIFFERENCE_STEP)


def symmetrise_rotations(model: mujoco.MjModel, matrix: Real) -> Real:
    """Return a matrix whose blocks of ball and free joints' rotations are symmetric; (..., nv, nv).

    The coordinates of such a rotation are the components of one rotation vector in axes that turn
    along. The derivative of a moment m then holds ``[m]x / 2`` beside the second derivative of the
    potential. At rest the moments of all forces cancel, so each force may omit its own part.

    Args:
        matrix: derivatives of generalised forces by joint coordinates; (..., nv, nv).
    """
    result = matrix.copy()
    for joint in range(model.njnt):
        dofs = np.flatnonzero(model.dof_jntid == joint)[-3:]
        if len(dofs) == 3:
            block = matrix[..., dofs[:, None], dofs]
            result[..., dofs[:, None], dofs] = (block + np.swapaxes(block, -1, -2)) / 2
    return result


def compute_forces(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    skipped: Container[Callable[[mujoco.MjModel, mujoco.MjData], None]] = (),
) -> None:
    """Compute what depends on position, velocity and controls, without forces of constraints.

    These are the steps of ``mj_fwdPosition`` without the factorisation of the mass matrix, which no
    force needs and which takes most of the time of a large machine. MuJoCo's solver of constraints
    is left out: a machine in which one acts is refused, and for some thousand contacts the solver's
    memory ends.

    Args:
        data: the state; filled in place.
        skipped: steps of the position that are left out, since the forces do not depend on them
            or their results are there.
    """
    for step in _POSITION_STEPS:
        if step not in skipped:
            step(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)


def net_force(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the generalised force r that vanishes at rest; (nv,).

    Equality constraints that are left to MuJoCo add their force without acceleration,
    -J' (b J v + k c) / R; see ``soft_inertia``.
    """
    force: Real = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
    if data.ne:
        rows = dense_rows(model, data)[: data.ne]
        stiffness, damping, impedance = data.efc_KBIP[: data.ne, :3].T
        pull = damping * (rows @ data.qvel) + stiffness * impedance * data.efc_pos[: data.ne]
        force = force - rows.T @ (pull / data.efc_R[: data.ne])
    return force


def soft_inertia(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return what equality constraints that are left to MuJoCo add to the mass matrix; (nv, nv).

    MuJoCo's constraint gives way with R f = -(J q'' + b J v + k c) (manual, Computation,
    "Parameters"): a mass 1/R, a damper b/R and a spring k/R, side by side across the constraint.
    """
    rows = dense_rows(model, data)[: data.ne]
    return rows.T @ (rows / data.efc_R[: data.ne, None])


def force_scale(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the size of the forces that have to balance: the largest of weight, tension, net.

    Lengths of tendons are differences of positions. So an elongation of ``_LENGTH_SHARE`` of the
    machine's size counts as tension, or the rounding of a relaxed tendon would be all of the scale.
    """
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    rounding = _LENGTH_SHARE * model.stat.extent
    tension = np.abs(model.tendon_stiffness) * (np.abs(tendon_elongation(model, data)) + rounding)
    pull = (tension[:, None] * np.abs(tendon_jacobian(model, data))).max(initial=0.0)
    net = np.abs(net_force(model, data)).max(initial=0.0)
    return max(weight, float(pull), float(net), 1e-300)


def force_slopes(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    along: Literal["position", "velocity"],
    velocity: Real | None = None,
    step: float = FORCE_DIFFERENCE_STEP,
) -> tuple[Real, Real]:
    """Return minus the central differences of the force, and how far they differ between sides.

    Args:
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
    skipped: tuple[Callable[..., None], ...] = (mujoco.mj_makeM,)
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
            compute_forces(model, probe, skipped)
            if along == "velocity":  # all positions are those of the first column
                skipped = _POSITION_STEPS
            forces.append(net_force(model, probe).copy())
        middle = forces.pop() if middle is None else middle
        slope[:, column] = -(forces[0] - forces[1]) / (2 * step)
        kink[:, column] = (forces[0] - 2 * middle + forces[1]) / step
    return slope, kink


def remaining_stiffness_and_damping(
    model: mujoco.MjModel, data: mujoco.MjData, velocity: Real
) -> tuple[Real, Real, Real]:
    """Return stiffness, damping and force beside gravity and linear springs of joints and tendons.

    They are those of actuators, polynomial terms and the gyroscopic and centrifugal forces of
    steady motion. They are central differences of the forces, with gravity and the linear joint
    and tendon coefficients set to zero. So a machine without such effects gets exact zeros instead
    of rounding noise of its stiff springs. The part of tendon tension is ``tendon_curvature``.

    Args:
        model: the compiled model; left as it was.
        data: at the static equilibrium.
        velocity: of the joint coordinates in steady motion [m/s, rad/s]; (nv,).

    Returns:
        K [N/m, N m/rad], C [N s/m, N m s/rad], (nv, nv) each, and the force at rest; (nv,).
    """
    zeroed = ("jnt_stiffness", "dof_damping", "tendon_stiffness", "tendon_damping")
    step = choose_difference_step(model, data)
    original = {name: getattr(model, name).copy() for name in zeroed}
    gravity = model.opt.gravity.copy()
    try:
        for name in zeroed:
            getattr(model, name)[:] = 0.0
        model.opt.gravity[:] = 0.0
        stiffness, _ = force_slopes(model, data, "position", velocity, step)
        stiffness = stiffness if velocity.any() else symmetrise_rotations(model, stiffness)
        damping, _ = force_slopes(model, data, along="velocity", velocity=velocity)
        probe = copy.copy(data)
        probe.qvel[:] = velocity
        compute_forces(model, probe)
        force = net_force(model, probe)
    finally:
        model.opt.gravity[:] = gravity
        for name, value in original.items():
            getattr(model, name)[:] = value
    return stiffness, damping, force
