"""Forces of a machine's actuators per unit of their controls."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.tendons import tendon_body_jacobian


@dataclass(frozen=True, eq=False)
class ActuatorGain:
    """Forces of an actuator per unit of its control.

    Args:
        joint: generalised forces of an actuator at a joint or fixed tendon; (nv,).
        body: forces at the centres of mass of an actuator at a site or spatial tendon;
            (6 n_body,).
    """

    joint: Real
    body: Real


def actuator_gains(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    stages: list[int],
    centres: tuple[Real, ...],
    jacobian: Real,
) -> dict[str, ActuatorGain]:
    """Return the gain of each actuator by name.

    Forces are linear in the control, so the generalised force is the difference of two controls.
    An actuator at a site without reference exerts a wrench along its gear, one at a spatial tendon
    the tendon's pull. These act at bodies, so that they follow when joints move.

    Args:
        model: the compiled model.
        data: at static equilibrium.
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.
        jacobian: T; (6 n_body, nv).
    """
    pulls = tendon_body_jacobian(model, data, stages, centres)
    gains = {}
    for actuator in range(model.nu):
        joint, body = _force_per_control(model, data, actuator), np.zeros(len(jacobian))
        wrench = _wrench_at_bodies(model, data, actuator, pulls, stages, centres)
        if wrench is not None and (row := jacobian.T @ wrench).any():
            body = wrench * (joint @ row) / (row @ row)
            joint = joint - jacobian.T @ body
        name = model.actuator(actuator).name or f"actuator{actuator}"
        gains[name] = ActuatorGain(joint, body)
    return gains


def _force_per_control(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> Real:
    """Return the generalised force per unit of an actuator's control; (nv,)."""
    probe = mujoco.MjData(model)
    probe.qpos[:] = data.qpos
    flags = model.opt.disableflags
    forces = []
    try:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        for control in (1.0, 0.0):
            probe.ctrl[:] = data.ctrl
            probe.ctrl[actuator] += control
            mujoco.mj_forward(model, probe)
            forces.append(probe.qfrc_actuator.copy())
    finally:
        model.opt.disableflags = flags
    difference: Real = forces[0] - forces[1]
    return difference


def _wrench_at_bodies(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuator: int,
    pulls: Mapping[int, Real],
    stages: list[int],
    centres: tuple[Real, ...],
) -> Real | None:
    """Return the wrench of a unit actuator force at the bodies, or None if it acts at joints.

    Args:
        model: the compiled model.
        data: at static equilibrium.
        actuator: its number.
        pulls: rows of the spatial tendons, by the number of the tendon.
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.
    """
    kind = mujoco.mjtTrn(model.actuator_trntype[actuator])
    target, reference = model.actuator_trnid[actuator]
    if kind == mujoco.mjtTrn.mjTRN_TENDON:
        return pulls.get(int(target))
    stage = model.body_weldid[model.site_bodyid[target]] if target >= 0 else 0
    if kind != mujoco.mjtTrn.mjTRN_SITE or reference >= 0 or stage not in stages:
        return None
    number = stages.index(stage)
    axes = data.site_xmat[target].reshape(3, 3)
    gear = model.actuator_gear[actuator]
    force, torque = axes @ gear[:3], axes @ gear[3:]
    wrench = np.zeros((len(stages), 6))
    wrench[number, :3] = force
    wrench[number, 3:] = torque + np.cross(data.site_xpos[target] - centres[number], force)
    return wrench.ravel()
