"""Keyframes of an MJCF: where the search for equilibrium starts; those of a copy with joints."""

from collections.abc import Sequence
from pathlib import Path
from xml.dom import minidom

import mujoco
import numpy as np

from identification.words import InputError
from mbmodel.mjcf.read import compile_mjcf

HOME = "home"  # the keyframe that is used unless the user states another
DRAWING = ""  # states that no keyframe is used


def choose_keyframe(model: mujoco.MjModel, path: Path, stated: str | None) -> str:
    """Return the name of the keyframe that is used, or ``DRAWING`` for none.

    A keyframe without a name goes by its number, from 0.

    Args:
        stated: name that the user states; None for ``home`` if there is one, else the drawing.

    Raises:
        InputError: the file has no keyframe of this name.
    """
    names = _names(model)
    if stated is None:
        return HOME if HOME in names else DRAWING
    if stated != DRAWING and stated not in names:
        choice = f"choose one of {', '.join(names)}" if names else "it has none"
        raise InputError(f"{path} has no keyframe {stated!r}: {choice}")
    return stated


def _names(model: mujoco.MjModel) -> list[str]:
    """Return the names of the keyframes, or their numbers."""
    return [model.key(number).name or str(number) for number in range(model.nkey)]


def pose_data(model: mujoco.MjModel, keyframe: str) -> mujoco.MjData:
    """Return a machine in the pose of a keyframe, at rest, or in that of the drawing.

    Joints, controls and mocap bodies are those of the keyframe. Its velocities are not used.
    Activations of filters and muscles have followed their controls; those of integrators stay.

    Args:
        keyframe: as ``choose_keyframe`` returns it.
    """
    data = mujoco.MjData(model)
    if keyframe != DRAWING:
        mujoco.mj_resetDataKeyframe(model, data, _names(model).index(keyframe))
        data.qvel[:] = 0.0
        data.time = 0.0
    for actuator in np.flatnonzero(model.actuator_actnum):
        if mujoco.mjtDyn(model.actuator_dyntype[actuator]) != mujoco.mjtDyn.mjDYN_INTEGRATOR:
            control = data.ctrl[model.actuator_ctrladr[actuator]]
            if model.actuator_actlimited[actuator]:
                control = np.clip(control, *model.actuator_actrange[actuator])
            data.act[model.actuator_actadr[actuator]] = control
    return data


def keyframe_remarks(model: mujoco.MjModel, keyframe: str) -> tuple[str, ...]:
    """Return which keyframe is used, or that there are keyframes of which none is used.

    Args:
        keyframe: as ``choose_keyframe`` returns it.
    """
    names = _names(model)
    if not names:
        return ()
    if keyframe == DRAWING:
        return (
            f"the file has keyframes ({', '.join(names)}), of which none is used: state one by "
            "key, or name it home",
        )
    remark = f"keyframe {keyframe!r} gives pose and controls"
    if model.key_qvel[names.index(keyframe)].any():
        remark += "; its velocities are not used: state rates of hinges by spin"
    return (remark,)


def count_joints(element: minidom.Element) -> int:
    """Return how many joint coordinates an added element brings: itself or those inside it."""
    inside = len(element.getElementsByTagName("joint"))
    return inside + (element.tagName == "joint") if element.tagName in ("joint", "body") else 0


def extend_keyframes(
    document: minidom.Document, source: Path, added: Sequence[tuple[str, minidom.Element]]
) -> None:
    """Insert the positions of added slides and hinges, zero, into every keyframe of a document.

    MuJoCo orders positions by body, depth first, and by joint within a body. An added joint is the
    last one of its body; an added body is the last child of its parent.

    Args:
        document: the MJCF with the additions; changed in place.
        source: the MJCF without them.
        added: each added element with the name of its parent.
    """
    keys = [
        key
        for section in document.getElementsByTagName("keyframe")
        for key in section.getElementsByTagName("key")
    ]
    if not keys or not any(count_joints(element) for _, element in added):
        return
    model = compile_mjcf(source)
    places = [
        _joint_number(model, parent, behind_children=element.tagName == "body")
        for parent, element in added
        for _ in range(count_joints(element))
    ]
    starts = {
        "qpos": np.append(model.jnt_qposadr, model.nq),
        "qvel": np.append(model.jnt_dofadr, model.nv),
    }
    for key in keys:
        for attribute, start in starts.items():
            if words := key.getAttribute(attribute).split():
                longer = np.insert(np.array(words, object), start[places], "0")
                key.setAttribute(attribute, " ".join(longer))


def _joint_number(model: mujoco.MjModel, parent: str, *, behind_children: bool) -> int:
    """Return the number of the joint before which an added joint comes.

    Args:
        model: the compiled model without the addition.
        parent: name of the body that gets it, or ``worldbody``.
        behind_children: whether it comes after the joints of all bodies that the parent carries.
    """
    body = 0 if parent == "worldbody" else model.body(parent).id
    last = body
    while behind_children and last + 1 < model.nbody and _carries(model, body, last + 1):
        last += 1
    return int((model.jnt_bodyid <= last).sum())


def joint_number_behind(model: mujoco.MjModel, parent: str) -> int:
    """Return the number of the joint before which those of a further child of a body come.

    Args:
        model: the compiled model without the child.
        parent: name of the body.
    """
    return _joint_number(model, parent, behind_children=True)


def _carries(model: mujoco.MjModel, body: int, above: int) -> bool:
    """Return whether a body stands on another one, directly or through others."""
    while above > body:
        above = int(model.body_parentid[above])
    return above == body
