r"""A stage elsewhere: joints moved together with the rest of their springs.

In a closed chain other joints follow, and their springs rest there too: the machine is as if it
were drawn in the pose. Newton's method solves c(q) = 0 with the named joints held, in steps, so
that the machine stays on the branch on which it was put together. The joints that follow as drawn
move. Where these do not suffice, as for the length of one strut of a platform, all others move with
the least strain energy sum k_j dq_j^2 of the springs.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Integers, Real, shorten_names
from mbmodel.linearisation.chain_closure import (
    MAX_REFUSED_GAP,
    close_chains,
    coordinate_lengths,
    count_independent,
    refuse_open_chains,
    scale_rows,
)
from mbmodel.linearisation.closed_chains import Chains, find_chains
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.mjcf.names import joint_name

# Of the largest move [m or rad] by which the machine may rest farther off than as drawn: gravity
# makes it sag otherwise elsewhere.
_MAX_RETURN_SHARE = 0.01
_SAME_REST = 1e-9  # m or rad: rounding of the search for rest
_MAX_CHAIN_STEP = 0.05  # of the machine's size, or rad: chains follow in such steps
_FREE_SHARE = 1e-8  # of the largest stiffness: what a joint without a spring counts


@dataclass(frozen=True, eq=False)
class StagePose:
    """A pose of a machine.

    Args:
        moves: of slides and hinges by the joint's name [m, rad].
        drawn: the pose from which they move.
        start: the pose.
        shift: of the positions at which springs rest [m, rad]; (nq,).
        following: joint coordinates that follow in closed chains, chosen as drawn; None without a
            chain.
    """

    moves: Mapping[str, float]
    drawn: mujoco.MjData
    start: mujoco.MjData
    shift: Real
    following: Integers | None


def move_joints(
    model: mujoco.MjModel, data: mujoco.MjData, pose: Mapping[str, float], path: Path
) -> StagePose | None:
    """Move slides and hinges, and the positions at which their springs rest, in place.

    Args:
        data: the pose from which the joints move.
        pose: moves by the joint's name [m, rad].

    Returns:
        The pose; None if nothing is named.

    Raises:
        InputError: a joint that the model lacks or that is no slide or hinge, a move beyond the
            joint's range, or one that the chains do not follow.
    """
    if not pose:
        return None
    joints = np.array([_find_joint(model, name, path) for name in pose])
    addresses = model.jnt_qposadr[joints]
    targets = data.qpos[addresses] + np.array([*pose.values()])
    for joint, target, (name, move) in zip(joints, targets, pose.items(), strict=True):
        low, high = model.jnt_range[joint]
        if model.jnt_limited[joint] and not low <= target <= high:
            raise InputError(
                f"{path}: pose {name} = {move:g} lies beyond the joint's range {low:g} to "
                f"{high:g}: give a position within it"
            )
    chains = _close(model, data, path)
    drawn, start = copy.copy(data), data.qpos.copy()
    if chains is None:
        data.qpos[addresses] = targets
    else:
        held = model.jnt_dofadr[joints]
        reach = np.abs(targets - start[addresses]) / coordinate_lengths(model)[held]
        count = max(1, int(np.ceil(reach.max() / _MAX_CHAIN_STEP)))
        for k in range(1, count + 1):
            data.qpos[addresses] = start[addresses] + k / count * (targets - start[addresses])
            if not _follow(model, data, chains, held):
                words = ", ".join(f"{name} = {move:g}" for name, move in pose.items())
                raise InputError(
                    f"{path}: pose {words} cannot be reached, because the chain of "
                    f"{shorten_names(chains.constraint_names)} does not follow beyond "
                    f"{(k - 1) / count:.0%} of it: give a shorter move, or name fewer joints"
                )
    shift = data.qpos - start
    model.qpos_spring += shift
    following = None if chains is None else chains.following
    return StagePose(pose, drawn, copy.copy(data), shift, following)


def _close(model: mujoco.MjModel, data: mujoco.MjData, path: Path) -> Chains | None:
    """Close the chains of a drawing, and return them; None without any."""
    if find_chains(model, data) is None:
        return None
    refuse_open_chains(model, data, close_chains(model, data), path)
    return find_chains(model, data)


def _follow(model: mujoco.MjModel, data: mujoco.MjData, chains: Chains, held: Integers) -> bool:
    """Close chains with some coordinates held, in place; return whether they close."""
    unheld = np.setdiff1d(np.arange(model.nv), held)
    for moving in (np.setdiff1d(chains.following, held), unheld):
        probe = copy.copy(data)
        if close_chains(model, probe, moving, _soft_lengths(model)) <= MAX_REFUSED_GAP:
            data.qpos[:] = probe.qpos
            return True
    return False


def _soft_lengths(model: mujoco.MjModel) -> Real:
    """Return motions of the coordinates with one strain energy of their springs; (nv,)."""
    lengths = coordinate_lengths(model)
    stiffness = model.jnt_stiffness[model.dof_jntid] * lengths**2
    floor = _FREE_SHARE * max(float(stiffness.max(initial=0.0)), 1e-300)
    return lengths * np.sqrt(floor / (stiffness + floor))


def find_posed_chains(
    model: mujoco.MjModel, data: mujoco.MjData, following: Integers | None, path: Path
) -> Chains | None:
    """Return the closed chains in a pose, with the coordinates of the drawing.

    Args:
        data: at rest in the pose.
        following: joint coordinates that follow as drawn; None without a chain.

    Raises:
        InputError: these coordinates do not describe the pose.
    """
    chains = find_chains(model, data, following)
    if chains is None or following is None:
        return None
    rows = scale_rows(model, chains.closure)[:, following]
    if count_independent(rows) < len(following):
        raise InputError(
            f"{path}: in this pose the chain of {shorten_names(chains.constraint_names)} has a "
            "dead centre of the coordinates that are kept in the drawing: give a pose before it"
        )
    return chains


def refuse_return(model: mujoco.MjModel, pose: StagePose, rest: mujoco.MjData, path: Path) -> None:
    """Refuse a pose from which other forces pull the machine away.

    Args:
        model: with the springs moved.
        pose: as ``move_joints`` returns it.
        rest: where the machine rests.

    Raises:
        InputError: the machine rests elsewhere.
    """
    joints = np.array([_find_joint(model, name, path) for name in pose.moves])
    moves, addresses = np.array([*pose.moves.values()]), model.jnt_qposadr[joints]
    gone = (rest.qpos - pose.start.qpos)[addresses]
    allowed = max(_MAX_RETURN_SHARE * float(np.abs(moves).max()), _SAME_REST)
    if (np.abs(gone) > allowed).any():
        model.qpos_spring -= pose.shift
        sagged = find_equilibrium(model, path, pose.drawn).data.qpos - pose.drawn.qpos
        model.qpos_spring += pose.shift
        gone -= sagged[addresses]
    worst = int(np.argmax(np.abs(gone)))
    if abs(gone[worst]) > allowed:
        name, move = [*pose.moves.items()][worst]
        raise InputError(
            f"{path}: pose {name} = {move:g} is not where the machine rests: a tendon, an "
            f"actuator or gravity pulls it back by {abs(gone[worst]):.3g}; write a model of its "
            "own for this test"
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
