"""A machine whose rigid directions may give way: each becomes a coordinate on a stiff spring.

A joint that leaves a stage fewer than six directions holds the others rigid. What if one of them
gave way? Then T has one column more: all that the stage carries moves along the direction, at the
joint's point. Guides and bearings have axes of their own: those of the drawn joints, if any two of
them are parallel or at right angles, and for what they leave open the stage's own at rest. Here
each such direction along or about one of these three gets its coordinate and its axle, which moves
with the joint, held by

    k = m (300 w)^2,   m = t' Mb t

w the highest frequency asked for, and a damper k tau: FRFs differ from those of rigid directions by
some (w / 300 w)^2, 1e-5. A Part that lowers k lets the direction go, and its slope exists while it
is still held. tau is the median c / k of the machine's springs. Each direction is called by the
world axis that it is nearest to; no two of a stage are called alike.
"""

from dataclasses import dataclass, replace
from itertools import groupby, permutations

import numpy as np

from identification.words import Real
from mbmodel.compliance.extended_machine import widened
from mbmodel.machine import Axle, Machine
from mbmodel.spatial import twist

_HELD = 300.0
_USUAL = 1e-4  # s: the time constant where no spring has a damper
_LITTLE = 1e-2  # rad: axes that rest, or few digits, have turned by less are parallel
_DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Held:
    """A direction that is rigid as drawn.

    Args:
        stage: name of the body above the joint.
        dof: such as ``rx``, by the world axis that its own is nearest to.
        coordinate: its number among the joint coordinates of the loosened machine.
        reference: stiffness that would put all above it at the highest frequency [N/m, N m/rad].
        stiffness: that holds it [N/m] or [N m/rad].
        time_constant: of the damper beside it, c / k [s].
    """

    stage: str
    dof: str
    coordinate: int
    reference: float
    stiffness: float
    time_constant: float


def loosened(machine: Machine, highest_hz: float) -> tuple[Machine, tuple[Held, ...]]:
    """Give every rigid direction of every joint a coordinate of its own.

    Args:
        machine: as drawn.
        highest_hz: up to which frequency FRFs matter.

    Returns:
        The machine, and what is held; the same machine if nothing is.
    """
    tau = _time_constant(machine)
    columns: list[Real] = []
    held: list[Held] = []
    every: list[Axle] = []
    for stage, group in groupby(machine.axles, key=lambda axle: axle.stage):
        axles = list(group)
        every += axles
        point = axles[0].anchor
        reach = machine.reach(axles[0], point)
        for dof, direction in _rigid(axles, machine.drawing.bodies[stage].frame).items():
            column = reach @ direction
            mass = float(column @ machine.body_mass @ column)
            reference = mass * (2 * np.pi * highest_hz) ** 2
            number = len(machine.coordinates) + len(columns)
            held.append(Held(stage, dof, number, reference, _HELD**2 * reference, tau))
            columns.append(column)
            axis = direction[:3] + direction[3:]
            turns = dof.startswith("r")
            every.append(Axle(_named(stage, dof), number, stage, turns, point, axis))
    if not held:
        return machine, ()
    names = tuple(_named(one.stage, one.dof) for one in held)
    wider = widened(machine, names, np.column_stack(columns))
    stiffness, damping = wider.remaining_stiffness.copy(), wider.remaining_damping.copy()
    for one in held:
        stiffness[one.coordinate, one.coordinate] = one.stiffness
        damping[one.coordinate, one.coordinate] = one.stiffness * one.time_constant
    wider = replace(
        wider, remaining_stiffness=stiffness, remaining_damping=damping, axles=tuple(every)
    )
    return wider, tuple(held)


def _rigid(axles: list[Axle], body: Real) -> dict[str, Real]:
    """Directions that no joint of a stage leaves it, as twists at the first one's anchor, by name.

    Args:
        axles: the stage's.
        body: its axes at rest, in columns; (3, 3).
    """
    own = _nearest(_axes([axle.axis for axle in axles], body))
    known = [twist(axle.turns, axle.anchor - axles[0].anchor, axle.axis) for axle in axles]
    found: dict[str, Real] = {}
    for dof, direction in zip(_DIRECTIONS, np.kron(np.eye(2), own).T, strict=True):
        before = np.linalg.matrix_rank(known, tol=_LITTLE)
        if np.linalg.matrix_rank([*known, direction], tol=_LITTLE) > before:
            known.append(direction)
            found[dof] = direction
    return found


def _axes(drawn: list[Real], body: Real) -> Real:
    """Three at right angles, in columns: of drawn joints, and for what they leave open the body's.

    Args:
        drawn: axes of joints, unit vectors; (3,) each.
        body: the stage's own, in columns; (3, 3).
    """
    found: list[Real] = []
    for axis in drawn:
        cosines = np.array([abs(axis @ other) for other in found])
        if (cosines < _LITTLE).all():
            found.append(axis)
        elif not (cosines > np.cos(_LITTLE)).any():
            return body
    while len(found) < len(body):
        across = body - sum(np.outer(axis, axis) @ body for axis in found)
        lengths = np.linalg.norm(across, axis=0)
        longest = int(np.argmax(lengths))
        found.append(across[:, longest] / lengths[longest])
    return np.column_stack(found)


def _nearest(axes: Real) -> Real:
    """The same, each in the column of a world axis and along it, as near as all three can be."""
    orders = [list(order) for order in permutations(range(3))]
    best = max(orders, key=lambda order: float(np.abs(np.diag(axes[:, order])).sum()))
    ordered = axes[:, best]
    return ordered * np.where(np.diag(ordered) < 0, -1.0, 1.0)


def _named(stage: str, dof: str) -> str:
    return f"{stage}.held_{dof}"


def _time_constant(machine: Machine) -> float:
    """Median c / k of springs that have both [s]."""
    known = [
        one.damping / one.stiffness
        for one in machine.springs
        if one.stiffness > 0 and one.damping > 0
    ]
    return float(np.median(known)) if known else _USUAL
