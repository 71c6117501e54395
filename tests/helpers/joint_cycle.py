"""Force of a joint in a quasi-static cycle, as MuJoCo computes it."""

from pathlib import Path

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.keyframes import DRAWING, pose_data
from mbmodel.mjcf.names import joint_coordinate
from mbmodel.mjcf.read import compile_with_remarks


def cycle_joint(path: Path, joint: str, places: Real) -> Real:
    """Lead a joint's coordinate along a path and return the force of its springs.

    All other coordinates stay as drawn. MuJoCo steps once at each place, so that a yielding spring
    yields; its force is taken before. Dry friction is no spring and is left out: MuJoCo's solver
    balances it against the other forces, so a simulation under a slow force shows it.

    Args:
        path: of the MJCF.
        joint: name of a slide or hinge.
        places: of the coordinate from its ``springref`` [m or rad]; (n,).

    Returns:
        Force against the motion [N or N m]; (n,).

    Raises:
        UsageError: there is no such joint.
    """
    model, _ = compile_with_remarks(path, without_friction=True)
    model.opt.timestep = 1e-9  # the step shall not move the joint
    model.opt.gravity[:] = 0.0
    coordinate = joint_coordinate(model, joint)
    address = int(model.jnt_qposadr[model.dof_jntid[coordinate]])
    data = pose_data(model, DRAWING)
    drawn = data.qpos.copy()
    forces = np.empty(len(places))
    for number, place in enumerate(places):
        data.qpos[:], data.qvel[:] = drawn, 0.0
        data.qpos[address] = model.qpos_spring[address] + place
        mujoco.mj_step(model, data)
        data.qpos[:], data.qvel[:] = drawn, 0.0
        data.qpos[address] = model.qpos_spring[address] + place
        mujoco.mj_forward(model, data)
        forces[number] = -data.qfrc_passive[coordinate]
    return forces
