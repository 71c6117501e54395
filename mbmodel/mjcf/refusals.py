"""Refusal of what has no linear model: constraints that act, states of actuators, lost springs."""

from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError
from mbmodel.mjcf.names import actuator_name, equality_name, geom_name, joint_name, tendon_name
from mbmodel.mjcf.tendons import is_fixed_tendon

_DISABLE = mujoco.mjtDisableBit
_JOINT = mujoco.mjtJoint
# Activations that follow the control alone: they stay at rest, whatever the machine does.
_HELD_DYNAMICS = (
    mujoco.mjtDyn.mjDYN_INTEGRATOR,
    mujoco.mjtDyn.mjDYN_FILTER,
    mujoco.mjtDyn.mjDYN_FILTEREXACT,
    mujoco.mjtDyn.mjDYN_MUSCLE,
)
_CLOSED_RIGIDLY = (
    mujoco.mjtEq.mjEQ_CONNECT,
    mujoco.mjtEq.mjEQ_WELD,
    mujoco.mjtEq.mjEQ_JOINT,
    mujoco.mjtEq.mjEQ_TENDON,
)


def refuse_unlinearisable(path: Path, model: mujoco.MjModel) -> None:
    """Refuse springs, friction, actuators and constraints that have no linear model.

    What a flag of the file switches off is off, and is no reason to refuse it.

    Raises:
        InputError: with the name of the element and a remedy.
    """
    _refuse_flags(path, model)
    for joint in range(model.njnt):
        _check_joint(path, model, joint)
    for tendon in range(model.ntendon):
        _check_tendon(path, model, tendon)
    for actuator in range(model.nactuator):
        _check_actuator(path, model, actuator)
    for equality in np.flatnonzero(model.eq_active0).tolist():
        if mujoco.mjtEq(model.eq_type[equality]) not in _CLOSED_RIGIDLY:
            raise InputError(
                f"{path}: {equality_name(model, equality)} is of a kind that is not handled: "
                "write it as connect, weld, joint or tendon"
            )


def is_enabled(model: mujoco.MjModel, constraint: mujoco.mjtDisableBit) -> bool:
    """Return whether a kind of constraint acts: neither its flag nor that of all switches it off.

    Args:
        constraint: the flag of its kind.
    """
    return not model.opt.disableflags & (constraint | _DISABLE.mjDSBL_CONSTRAINT)


def _refuse_flags(path: Path, model: mujoco.MjModel) -> None:
    """Refuse an MJCF that switches all springs or all dampers off."""
    for word, flag in (("spring", _DISABLE.mjDSBL_SPRING), ("damper", _DISABLE.mjDSBL_DAMPER)):
        if model.opt.disableflags & flag:
            raise InputError(
                f'{path}: <flag {word}="disable"/> takes every {word} out of the machine: remove it'
            )


def _check_joint(path: Path, model: mujoco.MjModel, joint: int) -> None:
    """Refuse negative coefficients, springs that turn a ball, and friction."""
    element = f"joint {joint_name(model, joint)!r}"
    start, end = model.jnt_dofadr[joint], _end_of_dofs(model, joint)
    _refuse_negative(path, element, "stiffness", model.jnt_stiffness[joint])
    for value in model.dof_damping[start:end]:
        _refuse_negative(path, element, "damping", value)
    kind = _JOINT(model.jnt_type[joint])
    has_stiffness = model.jnt_stiffness[joint] or model.jnt_stiffnesspoly[joint].any()
    if kind == _JOINT.mjJNT_BALL and has_stiffness:
        raise InputError(f"{path}: {element} is a ball with stiffness: write it as three hinges")
    if kind == _JOINT.mjJNT_FREE and has_stiffness:
        raise InputError(
            f"{path}: {element} is free and has stiffness: write it as three slides and three "
            "hinges"
        )
    friction = model.dof_frictionloss[start:end]
    if (friction > 0).any() and is_enabled(model, _DISABLE.mjDSBL_FRICTIONLOSS):
        raise InputError(
            f"{path}: {element} has frictionloss, which has no linear model: remove it, or leave "
            "it out (--without friction)"
        )


def _end_of_dofs(model: mujoco.MjModel, joint: int) -> int:
    """Return the number behind the last coordinate of a joint."""
    return int(model.jnt_dofadr[joint + 1]) if joint + 1 < model.njnt else int(model.nv)


def _check_tendon(path: Path, model: mujoco.MjModel, tendon: int) -> None:
    """Refuse negative coefficients of a tendon between sites, and friction.

    A fixed tendon may subtract from the stiffness of its joints, but from a single joint no more
    than that has.
    """
    element = f"tendon {tendon_name(model, tendon)!r}"
    stiffness, damping = model.tendon_stiffness[tendon], model.tendon_damping[tendon]
    if not is_fixed_tendon(model, tendon):
        _refuse_negative(path, element, "stiffness", stiffness)
        _refuse_negative(path, element, "damping", damping)
    elif model.tendon_num[tendon] == 1:
        wrap = model.tendon_adr[tendon]
        joint, square = model.wrap_objid[wrap], float(model.wrap_prm[wrap]) ** 2
        drawn = model.jnt_stiffness[joint], model.dof_damping[model.jnt_dofadr[joint]]
        both = f"joint {joint_name(model, joint)!r} with {element}"
        _refuse_negative(path, both, "stiffness", min(stiffness, 0.0) * square + drawn[0])
        _refuse_negative(path, both, "damping", min(damping, 0.0) * square + drawn[1])
    if model.tendon_frictionloss[tendon] > 0 and is_enabled(model, _DISABLE.mjDSBL_FRICTIONLOSS):
        raise InputError(
            f"{path}: {element} has frictionloss, which has no linear model: remove it, or leave "
            "it out (--without friction)"
        )


def _check_actuator(path: Path, model: mujoco.MjModel, actuator: int) -> None:
    """Refuse actuators with a delay, an armature, or a state that the motion drives."""
    element = f"actuator {actuator_name(model, actuator)!r}"
    dynamics = mujoco.mjtDyn(model.actuator_dyntype[actuator])
    has_state = model.actuator_actnum[actuator] and dynamics not in _HELD_DYNAMICS
    if has_state or model.actuator_delay[actuator] > 0:
        raise InputError(
            f"{path}: {element} has a delay, or a state that its motion drives, which the linear "
            "model does not hold: remove it"
        )
    if model.actuator_armature[actuator]:
        raise InputError(f"{path}: {element} has armature: give it to its joint")


def _refuse_negative(path: Path, element: str, what: str, value: float) -> None:
    """Raise InputError unless a value is finite and at least 0."""
    if not (np.isfinite(value) and value >= 0):
        raise InputError(f"{path}: {element} has {what} {value:g}: give a number of 0 or more")


def active_constraint(model: mujoco.MjModel, data: mujoco.MjData) -> str | None:
    """Return a message about a contact, limit or yield that acts in a state, or None if none does.

    Args:
        data: after ``compute_forces`` at the state to check.
    """
    for contact in data.contact:
        if not contact.exclude:
            names = [geom_name(model, geom) for geom in contact.geom]
            return (
                f'contact between {names[0]} and {names[1]} is on: set contype="0" '
                'conaffinity="0" on one of them, or add an <exclude>'
            )
    if spring := _yielding_spring(model, data):
        return f"the spring of {spring} yields at rest: raise its springyield"
    if data.nefc == data.ne:  # equality constraints come first
        return None
    kind, number = mujoco.mjtConstraint(data.efc_type[data.ne]), int(data.efc_id[data.ne])
    if kind == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT:
        return f"the limit of joint {joint_name(model, number)!r} is reached: widen its range"
    if kind == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON:
        return f"the limit of tendon {tendon_name(model, number)!r} is reached: widen its range"
    return f"constraint {kind.name} number {number} is active: remove it"


def _yielding_spring(model: mujoco.MjModel, data: mujoco.MjData) -> str | None:
    """Return the joint or tendon whose spring is stretched beyond its yield, or None.

    MuJoCo shifts the spring's reference only when it steps in time.
    """
    for joint in np.flatnonzero(model.jnt_plasticadr >= 0):
        if _JOINT(model.jnt_type[joint]) in (_JOINT.mjJNT_SLIDE, _JOINT.mjJNT_HINGE):
            reference = data.plastic[model.jnt_plasticadr[joint]]
            stretch = abs(data.qpos[model.jnt_qposadr[joint]] - reference)
            if stretch >= model.jnt_springyield[joint]:
                return f"joint {joint_name(model, int(joint))!r}"
    for tendon in np.flatnonzero(model.tendon_plasticadr >= 0):
        start = model.tendon_plasticadr[tendon]
        low, high = data.plastic[start : start + 2]
        length = data.ten_length[tendon]
        if max(length - high, low - length) >= model.tendon_springyield[tendon]:
            return f"tendon {tendon_name(model, int(tendon))!r}"
    return None
