"""Keyframes of a copy of an MJCF to which joints were added: each gets their rest position."""

from collections.abc import Sequence
from pathlib import Path
from xml.dom import minidom

import mujoco
import numpy as np

from mbmodel.mjcf.read import compile_mjcf


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
