"""What a user must know of the pose at which a machine was linearised."""

import mujoco
import numpy as np

from mbmodel.linearisation.equilibrium import Rest
from mbmodel.mjcf.read import joint_name

_FAR = 1e-3  # m or rad from the drawing that are worth a word


def rest_remarks(model: mujoco.MjModel, rest: Rest) -> tuple[str, ...]:
    """Say how far the machine stands from its drawing, and whether it would stay there."""
    remarks = []
    if model.nv and np.abs(rest.moved).max() > _FAR:
        worst = int(np.argmax(np.abs(rest.moved)))
        joint = joint_name(model, model.dof_jntid[worst])
        remarks.append(
            f"at rest joint {joint!r} stands {rest.moved[worst]:.3g} (m or rad) from the drawing: "
            "sensors and centres of mass are where the machine rests"
        )
    if not rest.stable:
        remarks.append(
            "the pose at rest is not stable: a small displacement would grow, and some poles have "
            "positive real parts"
        )
    return tuple(remarks)
