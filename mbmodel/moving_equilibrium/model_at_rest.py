"""A model at the static equilibrium of its parameters.

Springs, masses and joints decide where a hung or preloaded machine rests. MuJoCo gets their values,
finds the equilibrium, and the machine is linearised there. So a wire that carries a weight keeps
its tension when it is tuned stiffer: it stretches less.
"""

from dataclasses import replace
from typing import TypeVar

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.moving_equilibrium.posed_machine import machine_at_pose
from mbmodel.parts import BodyPart, JointPart, Part, PartContext, SpringPart
from mbmodel.posed_model import PosedModel

ModelT = TypeVar("ModelT", bound=PosedModel)


def is_static(part: Part) -> bool:
    """Return whether the equilibrium depends on a Part: springs, bodies and joints of the MJCF."""
    return isinstance(part, SpringPart | BodyPart | JointPart)


def static_parameters(model: PosedModel, theta: Real) -> Real:
    """Return the parameters of theta on which the equilibrium depends, one after the other."""
    chosen = [
        values
        for part, values in zip(model.parts, model.split_parameters(theta), strict=True)
        if is_static(part)
    ]
    return np.concatenate([*chosen, np.zeros(0)])


def static_edits(model: PosedModel, theta: Real) -> list[Edit | Addition | NotInMjcf]:
    """Return what static Parts write into the MJCF at theta."""
    return [
        edit
        for part, values in zip(model.parts, model.split_parameters(theta), strict=True)
        if is_static(part)
        for edit in part.write(values)
    ]


def model_at_rest(model: ModelT, theta: Real) -> ModelT:
    """Return a model at its static equilibrium at theta.

    Args:
        model: whose machine has its statics.
        theta: parameters in SI; (n_parameter,).

    Raises:
        ConvergenceError: the machine has no equilibrium there.
    """
    statics = model.machine.statics
    if statics is None:
        return model
    changed = statics.with_edits(static_edits(model, theta))
    return model_at_pose(model, theta, changed, statics.find_pose(changed))


def model_at_pose(model: ModelT, theta: Real, changed: mujoco.MjModel, position: Real) -> ModelT:
    """Return a model at a pose, at rest or not.

    MuJoCo's Jacobian holds what the Parts of joints add to T. It is taken off here, since these
    Parts add it again.

    Args:
        model: whose machine has its statics.
        theta: parameters in SI; (n_parameter,).
        changed: the compiled MJCF at theta.
        position: joint positions [m, rad]; (nq,).
    """
    statics = model.machine.statics
    if statics is None:
        return model
    machine = machine_at_pose(model.machine, statics, changed, position)
    size, nv = 6 * len(statics.stages), changed.nv
    jacobian = machine.jacobian.copy()
    context = PartContext(machine)
    for part, values in zip(model.parts, model.split_parameters(theta), strict=True):
        if isinstance(part, JointPart) and values.any():
            for change in part.changes(values, context):
                added = change.left @ change.core[0] @ change.right.T
                jacobian[:size, :nv] -= added[:size, :nv]
    machine = replace(machine, jacobian=jacobian)
    springs = {spring.name: spring for spring in machine.springs}
    parts = tuple(
        replace(part, springs=tuple(springs[spring.name] for spring in part.springs))
        if isinstance(part, SpringPart)
        else part
        for part in model.parts
    )
    return replace(model, machine=machine, parts=parts)
