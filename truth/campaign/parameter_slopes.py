r"""Slopes of a machine's matrices by each parameter of a refit but those of the sensors.

Stiffness and damping by their logarithms, tolerances by one standard deviation each. The slopes of
M, C, K and G, of the sensors' rows L and of the hammers' columns P are exact, or central
differences of matrices where a place moves.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.campaign.draw import Tolerances
from truth.campaign.machine_on_test import TrueMachine
from truth.machine.couplings import coupled_matrices, tendon_rows
from truth.machine.dynamics import (
    Equations,
    hammer_columns,
    joint_matrices,
    joint_rows,
    motion_row,
    sensor_rows,
)
from truth.machine.rig import Prepared, close_loop
from truth.machine.station import Integer, Real, StageBody, Station

_DIFFERENCE_STEP = 1e-3  # of a tolerance's standard deviation, for differences of matrices


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs and dampers of joints and tendons, each along one row of the coordinates.

    Args:
        rows: what each is stretched by the coordinates; (n_spring, n).
        stiffness: (n_spring,).
        damping: (n_spring,).
    """

    rows: Real
    stiffness: Real
    damping: Real


@dataclass(frozen=True, eq=False)
class Slopes:
    """Slopes of matrices by one parameter; what does not move is None.

    Args:
        equations: of M, C, K and G.
        sensors: of L: which rows, and their slopes; (n_row, n).
        hammers: of P; (n, n_hammer).
        loops: of where each control loop acts times what it reads; (n, n) each.
    """

    equations: Equations | None = None
    sensors: tuple[Integer, Real] | None = None
    hammers: Real | None = None
    loops: tuple[Real, ...] = ()


def list_springs(station: Station) -> Springs:
    """Return the springs and dampers of all joints, stage by stage, and then of the tendons."""
    size = 6 * len(station.stages)
    rows = [np.zeros((0, size))]
    rows += [joint_rows(station, index)[0] for index in range(len(station.stages))]
    if station.tendons:
        rows.append(tendon_rows(station))
    joints = [joint for stage in station.stages for joint in stage.joints]
    sizes = [(joint.stiffness, joint.damping) for joint in joints]
    sizes += [(tendon.stiffness, tendon.damping) for tendon in station.tendons]
    stiffness, damping = np.array(sizes).reshape(-1, 2).T
    return Springs(np.vstack(rows), stiffness, damping)


def slopes_by_tolerances(machine: TrueMachine, tolerance: Tolerances) -> Iterator[Slopes]:
    """Go through the slopes by the tolerances of bodies, places of joints, and hits.

    Args:
        machine: the true one, without effects.
        tolerance: standard deviations.
    """
    for index in range(len(machine.station.stages)):
        yield from _weights(machine.station, index, tolerance)
        yield from _places(machine, index, tolerance)
    for number in range(len(machine.hammers)):
        yield from _hits(machine, number, tolerance)


def _weights(station: Station, index: int, tolerance: Tolerances) -> Iterator[Slopes]:
    """By mass and by each of the six numbers of the inertia."""
    stage, size = station.stages[index], 6 * len(station.stages)
    mass = np.zeros((size, size))
    place = slice(6 * index, 6 * index + 3)
    mass[place, place] = tolerance.mass * stage.mass * np.eye(3)
    heavier = replace(stage, mass=stage.mass * (1 + tolerance.mass))
    weight = None
    if station.gravity.any():  # linear in the mass
        stages = (*station.stages[:index], heavier, *station.stages[index + 1 :])
        whole = coupled_matrices(replace(station, stages=stages)).stiffness
        weight = whole - coupled_matrices(station).stiffness
    yield _matrices(station, mass, weight)
    for row, column in zip(*np.triu_indices(3), strict=True):
        mass = np.zeros((size, size))
        first, second = 6 * index + 3 + row, 6 * index + 3 + column
        mass[first, second] = mass[second, first] = tolerance.inertia * stage.inertia[row, column]
        yield _matrices(station, mass)


def _matrices(station: Station, mass: Real, stiffness: Real | None = None) -> Slopes:
    size = 6 * len(station.stages)
    still = np.zeros((size, size))
    rigid = np.zeros((sum(6 - len(stage.joints) for stage in station.stages), size))
    return Slopes(Equations(mass, still, still if stiffness is None else stiffness, rigid))


def _places(machine: TrueMachine, index: int, tolerance: Tolerances) -> Iterator[Slopes]:
    """By a stage's centre of mass and by the place that its joints share."""
    station, stage = machine.station, machine.station.stages[index]
    children = [i for i, child in enumerate(station.stages) if child.parent == index]
    for axis in np.eye(3):
        shift = tolerance.com * axis
        ends = _ends(station, index, partial(_with_com, stage, shift))
        columns = [hammer_columns(end, machine.hammers) for end in ends]
        yield Slopes(
            _slope_of_joints(ends, (index, *children)),
            _slope_of_readings(ends),
            (columns[0] - columns[1]) / (2 * _DIFFERENCE_STEP),
            _slope_of_loops(ends),
        )
        if stage.joints:
            by = tolerance.joint_position * axis
            ends = _ends(station, index, partial(_move_joints, stage, by))
            yield Slopes(
                _slope_of_joints(ends, (index,)),
                _slope_of_readings(ends),
                loops=_slope_of_loops(ends),
            )


def _slope_of_readings(ends: tuple[Station, Station]) -> tuple[Integer, Real]:
    """Central difference of L: the rows that move, and their slopes; (n_row, n)."""
    slopes = (sensor_rows(ends[0]) - sensor_rows(ends[1])) / (2 * _DIFFERENCE_STEP)
    moving = np.flatnonzero(slopes.any(axis=1))
    return moving, slopes[moving]


def _slope_of_loops(ends: tuple[Station, Station]) -> tuple[Real, ...]:
    """Central difference of the matrix by which each loop's stiffness acts; (n, n) each."""
    laws = ([close_loop(Prepared(end, ()), loop) for loop in end.loops] for end in ends)
    return tuple(
        (np.outer(ahead.column, ahead.row) - np.outer(behind.column, behind.row))
        / (2 * _DIFFERENCE_STEP)
        for ahead, behind in zip(*laws, strict=True)
    )


def _with_com(stage: StageBody, shift: Real, way: float) -> StageBody:
    return replace(stage, com=stage.com + way * shift)


def _move_joints(stage: StageBody, shift: Real, way: float) -> StageBody:
    joints = tuple(replace(joint, position=joint.position + way * shift) for joint in stage.joints)
    return replace(stage, joints=joints)


def _ends(
    station: Station, index: int, move: Callable[[float], StageBody]
) -> tuple[Station, Station]:
    """The station with a stage a step to either side."""
    ends = []
    for way in (_DIFFERENCE_STEP, -_DIFFERENCE_STEP):
        stages = list(station.stages)
        stages[index] = move(way)
        ends.append(replace(station, stages=tuple(stages)))
    return ends[0], ends[1]


def _slope_of_joints(ends: tuple[Station, Station], indices: tuple[int, ...]) -> Equations:
    """Central difference of M, C, K and G, of which the joints of a few stages alone move."""
    sizes = [6 - len(stage.joints) for stage in ends[0].stages]
    size = 6 * len(sizes)
    mass, damping, stiffness = np.zeros((3, size, size))
    rigid = np.zeros((sum(sizes), size))
    coupled = [coupled_matrices(station) for station in ends]
    mass += coupled[0].mass - coupled[1].mass
    damping += coupled[0].damping - coupled[1].damping
    stiffness += coupled[0].stiffness - coupled[1].stiffness
    for index in indices:
        ahead, behind = (joint_matrices(station, index) for station in ends)
        damping += ahead[0] - behind[0]
        stiffness += ahead[1] - behind[1]
        first = sum(sizes[:index])
        rigid[first : first + sizes[index]] = ahead[2] - behind[2]
    over = 1 / (2 * _DIFFERENCE_STEP)
    return Equations(mass * over, damping * over, stiffness * over, rigid * over)


def _hits(machine: TrueMachine, number: int, tolerance: Tolerances) -> Iterator[Slopes]:
    """By the direction and the place of one hammer."""
    hammer = machine.hammers[number]
    if hammer.along:  # a motor acts as the model says
        return
    for axis in np.eye(3):
        turn = tolerance.hammer_angle * np.cross(axis, hammer.direction)
        for direction, position in (
            (turn, hammer.position),
            (hammer.direction, tolerance.hammer_position * axis),
        ):
            column = motion_row(machine.station, hammer.stage, position, direction)
            if position is not hammer.position:  # a column is affine in the place
                column = column - motion_row(
                    machine.station, hammer.stage, np.zeros(3), hammer.direction
                )
                column[6 * hammer.stage : 6 * hammer.stage + 3] = 0.0
            columns = np.zeros((len(column), len(machine.hammers)))
            columns[:, number] = column
            yield Slopes(hammers=columns)
