"""Remarks for the user on the pose at which a machine was linearised."""

import mujoco
import numpy as np

from mbmodel.linearisation.equilibrium import Equilibrium
from mbmodel.mjcf.keyframes import DRAWING
from mbmodel.mjcf.names import joint_name

_MIN_REPORTED_DISPLACEMENT = 1e-3  # m or rad: a smaller displacement needs no remark


def equilibrium_remarks(
    model: mujoco.MjModel, equilibrium: Equilibrium, keyframe: str = DRAWING
) -> tuple[str, ...]:
    """Return how far the machine rests from its drawing, and whether its equilibrium is unstable.

    Args:
        model: the compiled model.
        equilibrium: the machine at rest.
        keyframe: name of the keyframe from which it was sought, if any.

    Returns:
        Sentences; empty if there is nothing to say.
    """
    remarks = []
    start = f"keyframe {keyframe!r}" if keyframe else "the drawing"
    if model.nv and np.abs(equilibrium.displacement).max() > _MIN_REPORTED_DISPLACEMENT:
        worst = int(np.argmax(np.abs(equilibrium.displacement)))
        joint = joint_name(model, model.dof_jntid[worst])
        remarks.append(
            f"at static equilibrium joint {joint!r} is displaced by "
            f"{equilibrium.displacement[worst]:.3g} (m or rad) from {start}: positions of "
            "sensors and centres of mass are those at equilibrium"
        )
    if not equilibrium.stable:
        remarks.append(
            "the static equilibrium is unstable: a small displacement grows, and some poles have "
            "positive real parts"
        )
    return tuple(remarks)
