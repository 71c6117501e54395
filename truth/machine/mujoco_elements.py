"""Elements of a compiled MJCF at rest: stages, joints, tendons, sensors, hammer points."""

import copy
import re
from typing import Literal, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from truth.machine.instruments import HitPoint, Sensor
from truth.machine.mujoco_forces import net_force, tendon_slopes
from truth.machine.springs import Joint, Motor, Real, Tendon

Integers: TypeAlias = NDArray[np.intp]

_AT_SITES = (mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtTrn.mjTRN_SLIDERCRANK)
_NODE = re.compile(r"(\d+)$")
_HIT = re.compile(r"hit\d+$")
_ACCELEROMETER = re.compile(r"acc\d+$")


def welded_to(model: mujoco.MjModel) -> Integers:
    """Return for each body the one that leads its stage; 0 for the ground; (nbody,)."""
    lead = model.body_weldid.astype(np.intp)
    return np.where(model.body_mocapid[lead] >= 0, 0, lead)


def leads(model: mujoco.MjModel) -> list[int]:
    """Return the bodies that lead the stages, in MuJoCo's order."""
    return sorted(set(welded_to(model).tolist()) - {0})


def instruments(
    model: mujoco.MjModel, data: mujoco.MjData, lead: int
) -> tuple[tuple[Sensor, ...], tuple[HitPoint, ...]]:
    """Return the sensors and hammer points of a stage.

    A site whose name ends in a number is a sensor. Where sensors are named ``acc<node>``, a site
    of the same number, or one that a tendon or an actuator uses, is none.
    """
    welded = welded_to(model)
    moving = [
        site for site in range(model.nsite)
        if model.site(site).name and welded[model.site_bodyid[site]] > 0
    ]  # fmt: skip
    names = {site: str(model.site(site).name) for site in moving}
    proper = {int(name[3:]) for name in names.values() if _ACCELEROMETER.match(name)}
    used, sensors, hits = _used_sites(model), [], []
    for site, name in names.items():
        number = _NODE.search(name)
        if number is None or welded[model.site_bodyid[site]] != lead:
            continue
        node, place = int(number[1]), data.site_xpos[site].copy()
        axes = data.site_xmat[site].reshape(3, 3).T
        if _HIT.match(name):
            hits.append(HitPoint(node, place, axes))
        elif _ACCELEROMETER.match(name) or not (node in proper or (proper and site in used)):
            sensors.append(Sensor(node, place, axes, name=name))
    return tuple(sensors), tuple(hits)


def _used_sites(model: mujoco.MjModel) -> set[int]:
    """Return the sites that tendons and actuators use."""
    used = set(model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE].tolist())
    for kind, targets in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if mujoco.mjtTrn(kind) in _AT_SITES:
            used |= {int(target) for target in targets if target >= 0}
    return used


def rigid_body(
    model: mujoco.MjModel, data: mujoco.MjData, members: Integers
) -> tuple[float, Real, Real]:
    """Return mass, centre of mass and inertia of welded bodies together, in world axes."""
    masses = model.body_mass[members]
    centre = masses @ data.xipos[members] / masses.sum()
    total = np.zeros((3, 3))
    for body, mass in zip(members, masses, strict=True):
        axes = data.ximat[body].reshape(3, 3)
        away = data.xipos[body] - centre
        total += axes @ np.diag(model.body_inertia[body]) @ axes.T
        total += mass * ((away @ away) * np.eye(3) - np.outer(away, away))
    return float(masses.sum()), centre, (total + total.T) / 2


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Return the name of a joint; ``<body>_joint<k>`` for the k-th of a body if unnamed."""
    if name := model.joint(joint).name:
        return str(name)
    body = int(model.jnt_bodyid[joint])
    lead = model.body(body).name or f"body{body}"
    return f"{lead}_joint{joint - model.body_jntadr[body]}"


def named_joints(model: mujoco.MjModel) -> dict[str, int]:
    """Return slides and hinges by their names."""
    kinds = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    return {
        joint_name(model, joint): joint
        for joint in range(model.njnt)
        if mujoco.mjtJoint(model.jnt_type[joint]) in kinds
    }


def joints_of(model: mujoco.MjModel, data: mujoco.MjData, lead: int) -> tuple[Joint, ...]:
    """Return the joints of a body; a ball is three hinges, a free joint three slides more."""
    joints = []
    start = int(model.body_jntadr[lead])
    for joint in range(start, start + int(model.body_jntnum[lead])):
        name, kind = joint_name(model, joint), mujoco.mjtJoint(model.jnt_type[joint])
        dof, anchor = int(model.jnt_dofadr[joint]), data.xanchor[joint].copy()
        frame = data.xmat[lead].reshape(3, 3)
        stiffness = float(model.jnt_stiffness[joint])
        axes: list[tuple[Literal["slide", "hinge"], Real]]
        if kind == mujoco.mjtJoint.mjJNT_SLIDE:
            axes = [("slide", data.xaxis[joint].copy())]
        elif kind == mujoco.mjtJoint.mjJNT_HINGE:
            axes = [("hinge", data.xaxis[joint].copy())]
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            axes, stiffness = [("hinge", axis) for axis in frame.T], 0.0
        else:
            axes = [("slide", axis) for axis in np.eye(3)]
            axes += [("hinge", axis) for axis in frame.T]
            anchor, stiffness = data.xpos[lead].copy(), 0.0
        for number, (turn, axis) in enumerate(axes):
            joints.append(
                Joint(
                    name=name if len(axes) == 1 else f"{name}.{number}",
                    kind=turn,
                    axis=axis,
                    position=anchor,
                    stiffness=stiffness,
                    damping=float(model.dof_damping[dof + number]),
                )
            )
    return tuple(joints)


def coordinates(model: mujoco.MjModel) -> list[str]:
    """Return the names of the joint coordinates, in MuJoCo's order."""
    names = [joint_name(model, int(joint)) for joint in model.dof_jntid]
    first = {name: names.index(name) for name in names}
    return [
        name if names.count(name) == 1 else f"{name}.{number - first[name]}"
        for number, name in enumerate(names)
    ]


def tendon_name(model: mujoco.MjModel, tendon: int) -> str:
    """Return the name of a tendon; ``tendon<number>`` if unnamed."""
    return str(model.tendon(tendon).name) or f"tendon{tendon}"


def motors_of(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Motor, ...]:
    """Return the motors that act on joints, with their forces per unit of the control."""
    names, motors = coordinates(model), []
    for number in range(model.nactuator):
        if model.actuator_ctrlnum[number] != 1:
            continue
        forces, probe = [], copy.copy(data)
        for change in (1e-6, 0.0):
            control = int(model.actuator_ctrladr[number])
            probe.ctrl[control] = data.ctrl[control] + change
            net_force(model, probe)
            forces.append(probe.qfrc_actuator.copy())
        slopes = ((forces[0] - forces[1]) / 1e-6).tolist()
        along = tuple((name, slope) for name, slope in zip(names, slopes, strict=True) if slope)
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, number)
        if along:
            motors.append(Motor(name or f"actuator{number}", along))
    return tuple(motors)


def tendons_of(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Tendon, ...]:
    """Return the tendons that are stretched or damped; one that is slack has no spring."""
    slopes, names, tendons = tendon_slopes(model, data), coordinates(model), []
    for number in range(model.ntendon):
        low, high = model.tendon_lengthspring[number]
        is_slack = low < data.ten_length[number] < high
        stiffness = 0.0 if is_slack else float(model.tendon_stiffness[number])
        damping = float(model.tendon_damping[number])
        if (stiffness or damping) and slopes[number].any():
            along = zip(names, slopes[number].tolist(), strict=True)
            row = tuple((name, slope) for name, slope in along if slope)
            tendons.append(Tendon(tendon_name(model, number), row, stiffness, damping))
    return tuple(tendons)
