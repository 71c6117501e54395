"""A stage elsewhere: joints moved together with the rest of their springs."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, shorten_names
from mbmodel.mjcf.names import joint_name

# Of the joint's move [m or rad] by which the machine may rest elsewhere: what gravity makes it sag.
_MAX_RETURN_SHARE = 0.01


def move_joints(
    model: mujoco.MjModel, data: mujoco.MjData, pose: Mapping[str, float], path: Path
) -> None:
    """Move slides and hinges, and the positions at which their springs rest, in place.

    Args:
        data: the pose from which the joints move.
        pose: moves by the joint's name [m, rad].

    Raises:
        InputError: a joint that the model lacks or that is no slide or hinge, or a move beyond the
            joint's range.
    """
    for name, move in pose.items():
        joint = _find_joint(model, name, path)
        address = model.jnt_qposadr[joint]
        model.qpos_spring[address] += move
        data.qpos[address] += move
        low, high = model.jnt_range[joint]
        if model.jnt_limited[joint] and not low <= data.qpos[address] <= high:
            raise InputError(
                f"{path}: pose {name} = {move:g} lies beyond the joint's range {low:g} to "
                f"{high:g}: give a position within it"
            )


def refuse_return(
    model: mujoco.MjModel,
    start: mujoco.MjData,
    rest: mujoco.MjData,
    pose: Mapping[str, float],
    path: Path,
) -> None:
    """Refuse a pose from which other forces pull the machine away.

    Args:
        start: the pose.
        rest: where the machine rests.
        pose: moves by the joint's name.

    Raises:
        InputError: the machine rests elsewhere.
    """
    for name, move in pose.items():
        address = model.jnt_qposadr[_find_joint(model, name, path)]
        gone = float(np.abs(rest.qpos[address] - start.qpos[address]))
        if gone > _MAX_RETURN_SHARE * abs(move):
            raise InputError(
                f"{path}: pose {name} = {move:g} is not where the machine rests: a tendon, an "
                f"actuator or gravity pulls it back by {gone:.3g}; write a model of its own for "
                "this test"
            )


def _find_joint(model: mujoco.MjModel, name: str, path: Path) -> int:
    """Return the number of a slide or hinge."""
    kinds = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    joints = {
        joint_name(model, joint): joint
        for joint in range(model.njnt)
        if mujoco.mjtJoint(model.jnt_type[joint]) in kinds
    }
    if name not in joints:
        raise InputError(
            f"{path}: pose names {name!r}, which is no slide or hinge of the model: choose one of "
            f"{shorten_names([*joints])}"
        )
    return joints[name]
