"""Stages of a compiled MJCF: bodies that can move, each with all bodies welded to it."""

import mujoco
import numpy as np

from identification.words import Integers

GROUND = 0  # MuJoCo's number of the world
_TIES_OF_BODIES = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)


def stage_numbers(model: mujoco.MjModel) -> Integers:
    """Return for each body the number of the body that leads its stage; (nbody,).

    It is ``GROUND`` for a body that cannot move. A mocap body has no joint: it stands still
    wherever the file puts it, so that it is ground.
    """
    lead = model.body_weldid.astype(np.intp)
    return np.where(model.body_mocapid[lead] >= 0, GROUND, lead)


def stage_of(model: mujoco.MjModel, body: int) -> int:
    """Return the number of the body that leads the stage of a body; ``GROUND`` if it is ground."""
    return int(stage_numbers(model)[body])


def stage_bodies(model: mujoco.MjModel) -> list[int]:
    """Return the number of the body that leads each stage, in MuJoCo's order."""
    return sorted(set(stage_numbers(model).tolist()) - {GROUND})


def stage_members(model: mujoco.MjModel, stage: int) -> Integers:
    """Return the numbers of all bodies of a stage.

    Args:
        stage: number of the body that leads it.
    """
    return np.flatnonzero(stage_numbers(model) == stage)


def tied_stages(model: mujoco.MjModel) -> dict[int, tuple[int, int]]:
    """Return the stages that connect and weld constraints tie, by the number of the constraint.

    A stage is given by the number of the body that leads it, ``GROUND`` if it is ground.
    """
    leads, ties = stage_numbers(model), {}
    for number in np.flatnonzero(model.eq_active0).tolist():
        if mujoco.mjtEq(model.eq_type[number]) not in _TIES_OF_BODIES:
            continue
        ends = np.array([model.eq_obj1id[number], model.eq_obj2id[number]])
        if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
            ends = model.site_bodyid[ends]
        first, second = leads[ends].tolist()
        ties[number] = first, second
    return ties
