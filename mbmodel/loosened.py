"""A machine whose rigid directions may give way: each becomes a coordinate on a stiff spring.

A joint that leaves a stage fewer than six directions holds the others rigid. What if one of them
gave way? Then T has one column more: all that the stage carries moves along the direction, at the
joint's point. Here each such direction along or about a world axis gets its coordinate and its
axle, which moves with the joint, held by

    k = m (300 w)^2,   m = t' Mb t

w the highest frequency asked for, and a damper k tau: FRFs differ from those of rigid directions by
some (w / 300 w)^2, 1e-5. A Part that lowers k lets the direction go, and its slope exists while it
is still held. tau is the median c / k of the machine's springs.
"""

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from identification.words import Real
from mbmodel.machine import Axle, Machine
from mbmodel.spatial import twist
from mbmodel.widened import widened

_HELD = 300.0
_USUAL = 1e-4  # s: the time constant where no spring has a damper
_INDEPENDENT = 1e-6
_DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Held:
    """A direction that is rigid as drawn.

    Args:
        stage: name of the body above the joint.
        dof: such as ``rx``, a world axis.
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
        known = [twist(axle.turns, axle.anchor - point, axle.axis) for axle in axles]
        reach = machine.reach(axles[0], point)
        for dof, direction in zip(_DIRECTIONS, np.eye(6), strict=True):
            if np.linalg.matrix_rank([*known, direction], tol=_INDEPENDENT) == len(known):
                continue
            known.append(direction)
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
