"""What the actuators of a machine do per unit of their controls."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.tendons import pulls_at_bodies


@dataclass(frozen=True, eq=False)
class Drive:
    """Forces of an actuator per unit of its control.

    Args:
        joint: generalised forces of an actuator at a joint or fixed tendon; (nv,).
        body: forces at the centres of mass, of one at a site or spatial tendon; (6 n_body,).
    """

    joint: Real
    body: Real


def motors_of(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    stages: list[int],
    centres: tuple[Real, ...],
    jacobian: Real,
) -> dict[str, Drive]:
    """What each actuator does per unit of its control, in which it is linear.

    The generalised force is the difference of two controls. At a site without reference it is a
    wrench along the gear, at a spatial tendon the tendon's pull: these act at bodies, so that they
    follow when joints move.

    Args:
        model: the compiled model.
        data: at static equilibrium.
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.
        jacobian: T; (6 n_body, nv).
    """
    pulls = pulls_at_bodies(model, data, stages, centres)
    drives = {}
    for actuator in range(model.nu):
        joint, body = _per_control(model, data, actuator), np.zeros(len(jacobian))
        along = _at_bodies(model, data, actuator, pulls, stages, centres)
        if along is not None and (row := jacobian.T @ along).any():
            body = along * (joint @ row) / (row @ row)
            joint = joint - jacobian.T @ body
        name = model.actuator(actuator).name or f"actuator{actuator}"
        drives[name] = Drive(joint, body)
    return drives


def _per_control(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> Real:
    probe = mujoco.MjData(model)
    probe.qpos[:] = data.qpos
    limits = model.opt.disableflags
    forces = []
    try:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        for control in (1.0, 0.0):
            probe.ctrl[:] = data.ctrl
            probe.ctrl[actuator] += control
            mujoco.mj_forward(model, probe)
            forces.append(probe.qfrc_actuator.copy())
    finally:
        model.opt.disableflags = limits
    difference: Real = forces[0] - forces[1]
    return difference


def _at_bodies(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuator: int,
    pulls: Mapping[int, Real],
    stages: list[int],
    centres: tuple[Real, ...],
) -> Real | None:
    """Wrench of a unit actuator force at the bodies, or None where it acts at joints."""
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
