"""Elements added to an MJCF, placed where the machine rests with other parameters.

An addition acts at the nominal rest, in axes that turn along with its body (``Pose``). So its ends
in that body's frame stay. An end x elsewhere goes along with the body, from its centre of mass c,

    x' = c' + R (x - c),

and keeps its distance: a tendon between two ends keeps its free length. A fixed tendon is
unstrained where its joints rest: its length is the sum of coefficients times q.
"""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.additions import fixed_tendon_at
from mbmodel.machine import Machine, Pose
from mbmodel.mjcf.edit import Addition, Edit, Element
from mbmodel.mjcf.names import joint_name


def move_to_rest(
    machine: Machine, pose: Pose | None, edits: Sequence[Edit | Addition]
) -> list[Edit | Addition]:
    """Return edits whose additions stand where they belong at a rest.

    Args:
        machine: at its nominal rest.
        pose: where the written machine rests; None at the nominal rest.
        edits: as Parts write them, for the nominal rest.
    """
    if pose is None or machine.statics is None:
        return list(edits)
    model = machine.statics.model
    rest = {
        joint_name(model, k): float(pose.position[model.jnt_qposadr[k]]) for k in range(model.njnt)
    }
    return [edit if isinstance(edit, Edit) else _move(machine, pose, rest, edit) for edit in edits]


def _move(machine: Machine, pose: Pose, rest: dict[str, float], addition: Addition) -> Addition:
    """Return an addition at a rest, whose joints are displaced by ``rest`` [m, rad]."""
    element = addition.element
    if element.tag == "fixed":
        return replace(addition, element=fixed_tendon_at(element, rest))
    if addition.beside in ("", addition.parent):
        return addition
    number = machine.layout.bodies.index(addition.beside)
    turn, centre = pose.turns[number], machine.layout.centres[number]
    point = np.array(element.values["pos"])
    parent = machine.drawing.bodies.get(addition.parent)
    if parent is not None:
        point = parent.origin + parent.frame @ point
    point = pose.centres[number] + turn @ (point - centre)
    if parent is not None:
        carrier = machine.layout.bodies.index(addition.parent)
        point = pose.turns[carrier].T @ (point - pose.centres[carrier])
        point = parent.frame.T @ (machine.layout.centres[carrier] + point - parent.origin)
    values = {**element.values, "pos": tuple(point.tolist())}
    if element.tag == "body":
        values["quat"] = _quaternion(turn)
    return replace(addition, element=Element(element.tag, values, element.children))


def _quaternion(turn: Real) -> tuple[float, ...]:
    """Return a rotation matrix as a quaternion; (4,)."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, turn.ravel())
    return tuple(quaternion.tolist())
