"""A machine whose rigid directions are released: each becomes a coordinate on a stiff spring.

A joint that leaves a stage fewer than six directions holds the others rigid. If a rigid direction
is released, T gets one more column: all that the stage carries moves along the direction, at the
joint's point. Guides and bearings have axes of their own: those of the drawn joints, if any two of
them are parallel or at right angles. The axes that they leave open are those of the stage at rest.
Each rigid direction along or about one of these three axes gets a coordinate and an axle that moves
with the joint. It is locked by the stiffness

    k = m (300 w)^2,   m = t' Mb t

with w the highest frequency of interest and t the column of T, and by a damper k tau. FRFs then
differ from those of rigid directions by some (w / 300 w)^2, 1e-5. A Part that lowers k releases the
direction, and its slope exists while the direction is still locked. tau is the median c / k of the
machine's springs. Each direction is named after the nearest world axis; no two of a stage have one
name.
"""

from dataclasses import dataclass, replace
from itertools import groupby, permutations

import numpy as np

from identification.words import DIRECTIONS, InputError, Real
from mbmodel.compliance.extended_machine import add_coordinates
from mbmodel.machine import RELEASED_MARK, Axle, Machine
from mbmodel.spatial import twist

# Natural frequency of a locked direction over the highest of interest: FRFs err by 1e-5.
_LOCKED_FREQUENCY_RATIO = 300.0
_DEFAULT_TIME_CONSTANT_S = 1e-4  # c / k of the damper if no spring of the machine has one
_PARALLEL_ANGLE_RAD = 1e-2  # axes this close are parallel: few digits and sag turn them by less


@dataclass(frozen=True, eq=False)
class RigidDirection:
    """A direction that is rigid as drawn.

    Args:
        stage: name of the body above the joint.
        dof: such as ``rx``, by the nearest world axis.
        coordinate: its number among the joint coordinates of the extended machine.
        reference: stiffness for which all above it would have a natural frequency at the highest
            frequency of interest [N/m, N m/rad].
        stiffness: of the spring that locks it [N/m, N m/rad].
        time_constant: of the damper beside it, c / k [s].
    """

    stage: str
    dof: str
    coordinate: int
    reference: float
    stiffness: float
    time_constant: float


def release_rigid_directions(
    machine: Machine, highest_hz: float
) -> tuple[Machine, tuple[RigidDirection, ...]]:
    """Give every rigid direction of every joint a coordinate of its own.

    Args:
        machine: as drawn.
        highest_hz: highest frequency of interest [Hz].

    Returns:
        The extended machine, and its rigid directions; the same machine if there are none.
    """
    tau = _time_constant(machine)
    columns: list[Real] = []
    rigid: list[RigidDirection] = []
    all_axles: list[Axle] = []
    for stage, group in groupby(machine.axles, key=lambda axle: axle.stage):
        axles = list(group)
        all_axles += axles
        if any(axle.chain_row is not None for axle in axles):  # closed, it would move the chain
            continue
        point = axles[0].anchor
        reach = machine.motion_per_twist(axles[0], point)
        for dof, direction in _rigid_twists(axles, machine.drawing.bodies[stage].frame).items():
            column = reach @ direction
            mass = float(column @ machine.body_mass @ column)
            reference = mass * (2 * np.pi * highest_hz) ** 2
            number = len(machine.coordinates) + len(columns)
            rigid.append(
                RigidDirection(
                    stage, dof, number, reference, _LOCKED_FREQUENCY_RATIO**2 * reference, tau
                )
            )
            columns.append(column)
            axis = direction[:3] + direction[3:]
            turns = dof.startswith("r")
            all_axles.append(Axle(_coordinate_name(stage, dof), number, stage, turns, point, axis))
    if not rigid:
        return machine, ()
    names = tuple(_coordinate_name(locked.stage, locked.dof) for locked in rigid)
    extended = add_coordinates(machine, names, np.column_stack(columns))
    stiffness, damping = extended.remaining_stiffness.copy(), extended.remaining_damping.copy()
    for locked in rigid:
        stiffness[locked.coordinate, locked.coordinate] = locked.stiffness
        damping[locked.coordinate, locked.coordinate] = locked.stiffness * locked.time_constant
    extended = replace(
        extended, remaining_stiffness=stiffness, remaining_damping=damping, axles=tuple(all_axles)
    )
    variants = {
        name: _released_alike(variant, highest_hz, extended, rigid)
        for name, variant in machine.variants.items()
    }
    return replace(extended, variants=variants), tuple(rigid)


def _released_alike(
    variant: Machine, highest_hz: float, nominal: Machine, rigid: list[RigidDirection]
) -> Machine:
    """Return a variant with the released directions and locking springs of the nominal machine.

    Raises:
        InputError: the variant is turned so far that its directions have other names.
    """
    released, _ = release_rigid_directions(variant, highest_hz)
    if released.coordinates != nominal.coordinates:
        raise InputError(
            f"{variant.source}: a test's pose turns a stage so far that its rigid directions are "
            "no longer those of the nominal pose: leave this test out for mbw diagnose"
        )
    stiffness, damping = released.remaining_stiffness.copy(), released.remaining_damping.copy()
    for locked in rigid:
        stiffness[locked.coordinate, locked.coordinate] = locked.stiffness
        damping[locked.coordinate, locked.coordinate] = locked.stiffness * locked.time_constant
    return replace(released, remaining_stiffness=stiffness, remaining_damping=damping)


def _rigid_twists(axles: list[Axle], body: Real) -> dict[str, Real]:
    """Return the directions that no joint of a stage leaves free, as twists (6,) by name.

    The twists refer to the anchor of the first joint.

    Args:
        axles: the stage's.
        body: axes of the stage at rest, in columns; (3, 3).
    """
    axes_of_stage = _order_as_world(_stage_axes([axle.axis for axle in axles], body))
    twists = [twist(axle.turns, axle.anchor - axles[0].anchor, axle.axis) for axle in axles]
    rigid: dict[str, Real] = {}
    for dof, direction in zip(DIRECTIONS, np.kron(np.eye(2), axes_of_stage).T, strict=True):
        before = np.linalg.matrix_rank(twists, tol=_PARALLEL_ANGLE_RAD)
        if np.linalg.matrix_rank([*twists, direction], tol=_PARALLEL_ANGLE_RAD) > before:
            twists.append(direction)
            rigid[dof] = direction
    return rigid


def _stage_axes(drawn: list[Real], body: Real) -> Real:
    """Return three orthogonal axes in columns; (3, 3).

    They are those of drawn joints; what these leave open is filled from the body's axes. If drawn
    axes are neither parallel nor orthogonal, the body's axes are returned.

    Args:
        drawn: axes of joints, unit vectors; (3,) each.
    """
    axes: list[Real] = []
    for axis in drawn:
        cosines = np.array([abs(axis @ chosen) for chosen in axes])
        if (cosines < _PARALLEL_ANGLE_RAD).all():
            axes.append(axis)
        elif not (cosines > np.cos(_PARALLEL_ANGLE_RAD)).any():
            return body
    while len(axes) < len(body):
        across = body - sum(np.outer(axis, axis) @ body for axis in axes)
        lengths = np.linalg.norm(across, axis=0)
        longest = int(np.argmax(lengths))
        axes.append(across[:, longest] / lengths[longest])
    return np.column_stack(axes)


def _order_as_world(axes: Real) -> Real:
    """Return axes in the order and sign that bring them nearest to the world axes; (3, 3)."""
    orders = [list(order) for order in permutations(range(3))]
    best = max(orders, key=lambda order: float(np.abs(np.diag(axes[:, order])).sum()))
    ordered = axes[:, best]
    return ordered * np.where(np.diag(ordered) < 0, -1.0, 1.0)


def _coordinate_name(stage: str, dof: str) -> str:
    """Return the name of a rigid direction's coordinate."""
    return f"{stage}{RELEASED_MARK}{dof}"


def _time_constant(machine: Machine) -> float:
    """Return the median c / k of springs that have both [s]."""
    time_constants = [
        spring.damping / spring.stiffness
        for spring in machine.springs
        if spring.stiffness > 0 and spring.damping > 0
    ]
    return float(np.median(time_constants)) if time_constants else _DEFAULT_TIME_CONSTANT_S
