"""Decision whether the equilibrium of a machine has to follow its parameters.

A machine whose springs carry nothing rests where it is drawn, whatever their stiffness. A stiff
machine that sags by a tenth of a millimetre moves, but neither its Jacobian nor its stiffness
notices. Only where they do, as in hung or preloaded machines, is the equilibrium sought anew.
"""

from dataclasses import replace

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.linearisation.statics import Statics, is_preloaded
from mbmodel.machine import Machine
from mbmodel.moving_equilibrium.slopes import EquilibriumPoint
from mbmodel.parts import Parameter, body_parts, spring_parts
from mbmodel.posed_model import PosedModel

# Of a column of T, and of an entry of K over the root of the two diagonal entries: what an e-fold
# of every stiffness and mass may change by moving the equilibrium. A fit changes them by a tenth of
# that, and then frequencies by less than 1e-4.
_MAX_UNNOTICED_CHANGE = 1e-3
_CENTRE_OF_MASS_MOVE = 0.003  # m: the default tolerance of a centre of mass
_RANDOM_DIRECTIONS = 2  # with random signs, beside the sum of all, so that nothing cancels
_ROUNDING_OF_STIFFNESS = 1e-8  # of the largest: less in a diagonal entry is no stiffness


def with_statics(
    machine: Machine, statics: Statics, data: mujoco.MjData, *, always: bool = False
) -> Machine:
    """Return a machine whose equilibrium follows its parameters, if that matters.

    Args:
        machine: at its nominal rest.
        data: at static equilibrium.
        always: whether it follows even if that changes T and K by next to nothing.
    """
    if machine.spinning or not is_preloaded(statics.model, data):
        return machine
    moving = replace(machine, statics=statics)
    if always or _largest_change(moving, statics) > _MAX_UNNOTICED_CHANGE:
        return moving
    return machine


def _largest_change(machine: Machine, statics: Statics) -> float:
    """Return the largest relative change of T or K through the equilibrium."""
    model = PosedModel(machine, spring_parts(machine) + body_parts(machine))
    point = EquilibriumPoint(model, model.drawn, statics, machine.pose)
    columns = [
        point.force_slopes(part, values) * [_reach(parameter) for parameter in part.parameters]
        for part, values in zip(model.parts, model.split_parameters(model.drawn), strict=True)
    ]
    moves = point.displacements(np.concatenate(columns, axis=1))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (moves.shape[1], _RANDOM_DIRECTIONS))
    directions = moves @ np.column_stack([np.ones(moves.shape[1]), signs])
    return max(_relative_change(point, direction) for direction in directions.T)


def _reach(parameter: Parameter) -> float:
    """Return by how much a parameter may be off: its size, or the tolerance of a centre."""
    return parameter.drawn if parameter.positive else _CENTRE_OF_MASS_MOVE


def _relative_change(point: EquilibriumPoint, direction: Real) -> float:
    """Return the relative change of T or K along a displacement of the equilibrium."""
    size = float(np.abs(direction).max(initial=0.0))
    if size == 0.0:
        return 0.0
    derivative = point.by_pose(direction / size)
    assembly = point.assembly
    columns = np.abs(assembly.jacobian).max(axis=0)
    moved = np.abs(derivative.jacobian[0]) / np.maximum(columns, 1e-300)
    stiffness = np.abs(assembly.matrices.stiffness)
    diagonal = stiffness.max(axis=0)
    floor = _ROUNDING_OF_STIFFNESS * float(diagonal.max(initial=0.0))
    scale = np.sqrt(np.outer(diagonal, diagonal)) + max(floor, 1e-300)
    stiffened = np.abs(derivative.coefficients[0, 0]) / scale
    return size * float(max(moved.max(initial=0.0), stiffened.max(initial=0.0)))
