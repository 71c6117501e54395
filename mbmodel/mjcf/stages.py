"""Stages of a compiled MJCF: bodies that can move, each with all bodies welded to it."""

import mujoco
import numpy as np

from identification.words import Integers

GROUND = 0  # MuJoCo's number of the world


def stage_numbers(model: mujoco.MjModel) -> Integers:
    """Return for each body the number of the body that leads its stage; (nbody,).

    It is ``GROUND`` for a body that cannot move. A mocap body has no joint: it stands still
    wherever the file puts it, so that it is ground.
    """
    lead = model.body_weldid.astype(np.intp)
    numbers: Integers = np.where(model.body_mocapid[lead] >= 0, GROUND, lead)
    return numbers


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
