"""Reading of MJCF files: MuJoCo compiles them, and what has no linear model is refused."""

import re
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from identification.words import InputError
from mbmodel.meshes.compile import compile_with_meshes
from mbmodel.mjcf.tendons import is_fixed_tendon

# Words of MuJoCo's own message, recognised to give a remedy.
_MUJOCO_MASSLESS_MESSAGE = "mass and inertia of moving bodies must be larger"
# Attributes that hold names, in which "nan" or "inf" is no number.
_TEXT_ATTRIBUTES = ("name", "class", "file", "childclass", "model", "joint", "body", "site", "mesh")
_NON_FINITE_WORD = re.compile(r"(?i)(?<!\S)[+-]?(nan|inf)(?!\S)")
_MUJOCO_ELEMENT_NAME = re.compile(r"Element name '(?P<name>[^']*)'")


def compile_mjcf(path: Path) -> mujoco.MjModel:
    """Compile an MJCF file and refuse what has no linear model.

    Args:
        path: the file.

    Returns:
        The compiled model.

    Raises:
        InputError: missing file, XML or MJCF that MuJoCo refuses, a body without mass, negative
            or non-finite stiffness or damping, equality constraints, dry friction, ball joints
            with stiffness, or a mesh that gives mass but does not bound a solid.
    """
    if not path.is_file():
        raise InputError(f"{path} does not exist: give the path of an MJCF file")
    _refuse_malformed(path)
    try:
        model = compile_with_meshes(path)
    except ValueError as error:
        raise InputError(_explain(path, str(error))) from error
    _refuse_unlinearisable(path, model)
    return model


def _refuse_malformed(path: Path) -> None:
    """Refuse malformed XML, and numbers that are not finite before MuJoCo logs them to a file."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        line = error.position[0]
        raise InputError(
            f"{path}, line {line}: not well-formed XML ({error}): correct it"
        ) from error
    for element in root.iter():
        name = element.get("name", "")
        if element.tag in ("body", "site") and ":" in name:
            raise InputError(
                f"{path}: {element.tag} {name!r} has a colon in its name, but labels such as "
                "acc1:+tx use the colon to separate point and direction: rename it"
            )
        for key, value in element.items():
            if key not in _TEXT_ATTRIBUTES and _NON_FINITE_WORD.search(value):
                raise InputError(
                    f"{path}: {element.tag} {name!r} has {key}={value!r}: give a finite number"
                )


def _explain(path: Path, message: str) -> str:
    """Return MuJoCo's message in one sentence, with a remedy where the cause is known."""
    text = " ".join(message.split())
    if _MUJOCO_MASSLESS_MESSAGE in text:
        match = _MUJOCO_ELEMENT_NAME.search(text)
        body = match["name"] if match else "?"
        return (
            f"{path}: body {body!r} moves but has no mass: give it an <inertial> or a geom with "
            "mass or density"
        )
    return f"{path}: MuJoCo refuses it: {text.removeprefix('XML Error: ').removeprefix('Error: ')}"


def _refuse_unlinearisable(path: Path, model: mujoco.MjModel) -> None:
    """Refuse springs, friction, actuators and constraints that have no linear model."""
    _refuse_flags(path, model)
    for joint in range(model.njnt):
        name = joint_name(model, joint)
        dofs = _dofs_of(model, joint)
        stiffness, damping = model.jnt_stiffness[joint], model.dof_damping[dofs]
        _refuse_negative(path, f"joint {name!r}", "stiffness", stiffness)
        for value in damping:
            _refuse_negative(path, f"joint {name!r}", "damping", value)
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        if kind == mujoco.mjtJoint.mjJNT_BALL and stiffness:
            raise InputError(
                f"{path}: joint {name!r} is a ball with stiffness: write it as three hinges"
            )
        if kind == mujoco.mjtJoint.mjJNT_FREE and stiffness:
            raise InputError(
                f"{path}: joint {name!r} is free and has stiffness: write it as three slides and "
                "three hinges"
            )
        if (model.dof_frictionloss[dofs] > 0).any():
            raise InputError(
                f"{path}: joint {name!r} has frictionloss, which has no linear model: remove it"
            )
    for tendon in range(model.ntendon):
        name = f"tendon {model.tendon(tendon).name!r}"
        if not _is_joint_coupling(model, tendon):
            _refuse_negative(path, name, "stiffness", model.tendon_stiffness[tendon])
            _refuse_negative(path, name, "damping", model.tendon_damping[tendon])
        if model.tendon_frictionloss[tendon] > 0:
            raise InputError(
                f"{path}: {name} has frictionloss, which has no linear model: remove it"
            )
    _refuse_actuators(path, model)
    active = np.flatnonzero(model.eq_active0)
    if active.size:
        name = model.equality(active[0]).name or f"number {active[0]}"
        raise InputError(
            f"{path}: equality constraint {name!r} closes a loop, which is not handled: replace it "
            "by a joint or a stiff tendon"
        )


def _refuse_flags(path: Path, model: mujoco.MjModel) -> None:
    """Refuse an MJCF that switches all springs or all dampers off."""
    bits = mujoco.mjtDisableBit
    for word, flag in (("spring", bits.mjDSBL_SPRING), ("damper", bits.mjDSBL_DAMPER)):
        if model.opt.disableflags & flag:
            raise InputError(
                f'{path}: <flag {word}="disable"/> takes every {word} out of the machine: remove it'
            )


def _refuse_actuators(path: Path, model: mujoco.MjModel) -> None:
    """Refuse actuators with a state, a delay or an armature."""
    for actuator in range(model.nu):
        if (
            mujoco.mjtDyn(model.actuator_dyntype[actuator]) != mujoco.mjtDyn.mjDYN_NONE
            or model.actuator_delay[actuator] > 0
        ):
            name = model.actuator(actuator).name or f"number {actuator}"
            raise InputError(
                f"{path}: actuator {name!r} has a state or a delay, which the linear model does "
                "not hold: remove it"
            )
        if model.actuator_armature[actuator]:
            name = model.actuator(actuator).name or f"number {actuator}"
            raise InputError(f"{path}: actuator {name!r} has armature: give it to its joint")


def _is_joint_coupling(model: mujoco.MjModel, tendon: int) -> bool:
    """Return whether a tendon couples several joints; its coefficients may then be negative."""
    return is_fixed_tendon(model, tendon) and model.tendon_num[tendon] > 1


def _refuse_negative(path: Path, element: str, what: str, value: float) -> None:
    """Raise InputError unless a value is finite and at least 0."""
    if not (np.isfinite(value) and value >= 0):
        raise InputError(f"{path}: {element} has {what} {value:g}: give a number of 0 or more")


def _dofs_of(model: mujoco.MjModel, joint: int) -> slice:
    """Return the joint coordinates of a joint."""
    start = model.jnt_dofadr[joint]
    end = model.jnt_dofadr[joint + 1] if joint + 1 < model.njnt else model.nv
    return slice(start, end)


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Return the name of a joint; ``<body>_joint<k>`` for the k-th joint of a body if unnamed."""
    if name := model.joint(joint).name:
        return str(name)
    body = model.jnt_bodyid[joint]
    owner = model.body(body).name or f"body{body}"
    return f"{owner}_joint{joint - model.body_jntadr[body]}"


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Return the name of a body; ``body<number>`` if unnamed."""
    return str(model.body(body).name) or f"body{body}"


def coordinate_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the joint coordinates: the joint's name, numbered if it has several."""
    names = [joint_name(model, joint) for joint in model.dof_jntid]
    count = {name: names.count(name) for name in names}
    start = {name: names.index(name) for name in names}
    return tuple(
        name if count[name] == 1 else f"{name}.{k - start[name]}" for k, name in enumerate(names)
    )


def active_constraint(model: mujoco.MjModel, data: mujoco.MjData) -> str | None:
    """Return a message about a contact or limit that acts in a state, or None if none acts.

    Args:
        model: the compiled model.
        data: after ``mj_forward`` at the state to check.
    """
    for contact in data.contact:
        if not contact.exclude:
            names = [_geom_name(model, geom) for geom in contact.geom]
            return (
                f'contact between {names[0]} and {names[1]} is on: set contype="0" '
                'conaffinity="0" on one of them, or add an <exclude>'
            )
    if not data.nefc:
        return None
    kind, number = mujoco.mjtConstraint(data.efc_type[0]), int(data.efc_id[0])
    if kind == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT:
        return f"the limit of joint {joint_name(model, number)!r} is reached: widen its range"
    if kind == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON:
        return f"the limit of tendon {model.tendon(number).name!r} is reached: widen its range"
    return f"constraint {kind.name} number {number} is active: remove it"


def _geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom, or of its body if it has none."""
    body = model.body(model.geom_bodyid[geom]).name
    name = model.geom(geom).name
    return f"geom {name!r} of body {body!r}" if name else f"a geom of body {body!r}"
