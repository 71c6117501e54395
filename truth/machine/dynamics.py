r"""Equations of motion in absolute coordinates, rows of sensors, columns of hammers.

Each stage has six coordinates: the translation u of its centre of mass and its small rotation
theta, in world axes. A point at r from the centre of mass moves by u + theta x r. Then

    M x'' + C x' + K x = f,   G x = 0

with M = blkdiag(m 1, I), a spring k and a damper c for each joint, and one row of G for each
direction in which a stage is rigid against its parent. Time convention exp(+i omega t).

A stage may bend: with a coordinate b of its own at the end, a point moves by the shape of its flex
times b more, and all rows (joints, sensors, hammers) follow from that.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.linalg

from truth.errors import TruthError
from truth.machine.station import GROUND, Hammer, Real, StageBody, Station


@dataclass(frozen=True, eq=False)
class Flex:
    """A mode in which a stage bends, one coordinate b.

    Args:
        stage: index.
        shape: of a position [m], (3,), the translation [m] and rotation [rad] per b; (6,).
        mass: modal mass, of b'' [kg].
        frequency: with the rigid motion held [Hz].
        damping: ratio.
    """

    stage: int
    shape: Callable[[Real], Real]
    mass: float
    frequency: float
    damping: float


@dataclass(frozen=True, eq=False)
class Equations:
    """M [kg, kg m2], C and K of n coordinates (n, n), and the rows G of the rigid ones (m, n).

    The first six coordinates of stage i start at 6 i; internal coordinates of effects follow.
    """

    mass: Real
    damping: Real
    stiffness: Real
    rigid: Real

    def with_coordinate(self) -> "Equations":
        """Return the equations with one more coordinate at the end, not joined to anything."""
        return Equations(
            mass=np.pad(self.mass, (0, 1)),
            damping=np.pad(self.damping, (0, 1)),
            stiffness=np.pad(self.stiffness, (0, 1)),
            rigid=np.pad(self.rigid, ((0, 0), (0, 1))),
        )


def assemble(station: Station, flexes: tuple[Flex, ...] = ()) -> Equations:
    """Assemble the station's equations of motion, rigid directions still as constraints."""
    n = 6 * len(station.stages) + len(flexes)
    mass, damping, stiffness = np.zeros((3, n, n))
    for place, flex in enumerate(flexes, start=6 * len(station.stages)):
        omega = 2 * np.pi * flex.frequency
        mass[place, place] = flex.mass
        damping[place, place] = 2 * flex.damping * omega * flex.mass
        stiffness[place, place] = omega**2 * flex.mass
    rigid: list[Real] = [np.zeros((0, n))]
    for index, stage in enumerate(station.stages):
        here = slice(6 * index, 6 * index + 6)
        mass[here, here] = scipy.linalg.block_diag(stage.mass * np.eye(3), stage.inertia)
        own_damping, own_stiffness, fixed = joint_matrices(station, index, flexes)
        damping += own_damping
        stiffness += own_stiffness
        rigid.append(fixed)
    return Equations(mass, damping, stiffness, np.vstack(rigid))


def joint_matrices(
    station: Station, index: int, flexes: tuple[Flex, ...] = ()
) -> tuple[Real, Real, Real]:
    """Return what the joints of one stage are in C, in K and in G."""
    joints = station.stages[index].joints
    moving, fixed = joint_rows(station, index, flexes)
    stiffness: Real = (moving.T * [joint.stiffness for joint in joints]) @ moving
    damping: Real = (moving.T * [joint.damping for joint in joints]) @ moving
    return damping, stiffness, fixed


def point_row(stage: StageBody, position: Real, direction: Real) -> Real:
    """Return the row d such that d x is the motion of a point of the stage along a direction.

    Its transpose is the generalised force of a unit force there; (6,), the stage's coordinates.
    """
    x, y, z = position - stage.com
    dx, dy, dz = direction
    return np.array([dx, dy, dz, y * dz - z * dy, z * dx - x * dz, x * dy - y * dx])


def motion_row(
    station: Station, index: int, position: Real, direction: Real, flexes: tuple[Flex, ...] = ()
) -> Real:
    """Return the row of a stage's point in all coordinates; (6 n_stages + n_flex,)."""
    row = np.zeros(6 * len(station.stages) + len(flexes))
    row[6 * index : 6 * index + 6] = point_row(station.stages[index], position, direction)
    for place, flex in enumerate(flexes, start=6 * len(station.stages)):
        if flex.stage == index:
            row[place] = direction @ flex.shape(position)[:3]
    return row


@lru_cache(maxsize=256)  # joints, tendons and each motor of one machine ask for them
def joint_rows(station: Station, index: int, flexes: tuple[Flex, ...] = ()) -> tuple[Real, Real]:
    """Return the rows that give a stage's joint coordinates, and those that must stay zero.

    The joints' axes span the relative motion: V = S q, V the motion of the stage against its
    parent at the first joint's position. So q = S^+ V, and what is orthogonal to S is rigid. For
    axes at right angles through one point S^+ = S^T.
    """
    stage = station.stages[index]
    point = stage.joints[0].position if stage.joints else stage.com
    S = np.zeros((6, len(stage.joints)))
    for column, joint in enumerate(stage.joints):
        if joint.kind == "slide":
            S[:3, column] = joint.axis
        else:
            S[:, column] = [*np.cross(joint.axis, point - joint.position), *joint.axis]
    if S.size and np.linalg.matrix_rank(S) < S.shape[1]:
        raise TruthError(f"body {stage.name}: two of its joints move it in the same direction")
    relative = motion_at(station, index, point, flexes)
    if stage.parent != GROUND:
        relative = relative - motion_at(station, stage.parent, point, flexes)
    orthogonal = np.linalg.qr(S, mode="complete")[0][:, S.shape[1] :]
    moving = np.linalg.pinv(S) @ relative if stage.joints else np.zeros((0, relative.shape[1]))
    fixed = orthogonal.T @ relative
    for rows in (moving, fixed):
        rows.flags.writeable = False
    return moving, fixed


def motion_at(station: Station, index: int, point: Real, flexes: tuple[Flex, ...]) -> Real:
    """Return translation of a stage's point and its rotation there; (6, n)."""
    motion = np.zeros((6, 6 * len(station.stages) + len(flexes)))
    motion[:3] = [motion_row(station, index, point, axis, flexes) for axis in np.eye(3)]
    motion[3:, 6 * index + 3 : 6 * index + 6] = np.eye(3)
    for place, flex in enumerate(flexes, start=6 * len(station.stages)):
        if flex.stage == index:
            motion[3:, place] = flex.shape(point)[3:]
    return motion


def sensor_rows(station: Station, flexes: tuple[Flex, ...] = ()) -> Real:
    """Return what the sensors read of the coordinates, with their gains; (3 n_sensors, n)."""
    rows = []
    for index, sensor in station.sensors():
        if sensor.joint:
            along = np.tile(drive_column(station, ((sensor.joint, 1.0),), flexes), (3, 1))
        else:
            along = np.array(
                [motion_row(station, index, sensor.position, axis, flexes) for axis in sensor.axes]
            )
        if sensor.cross.any() and not sensor.joint:
            rows += list(sensor.mixing @ along)
        else:
            rows += list(sensor.gain[:, None] * along)
    return np.array(rows).reshape(-1, 6 * len(station.stages) + len(flexes))


def hammer_columns(
    station: Station, hammers: tuple[Hammer, ...], flexes: tuple[Flex, ...] = ()
) -> Real:
    """Return generalised forces of unit hits; (n, n_hammers)."""
    columns = [
        drive_column(station, hammer.along, flexes)
        if hammer.along
        else motion_row(station, hammer.stage, hammer.position, hammer.direction, flexes)
        for hammer in hammers
    ]
    return np.array(columns).reshape(-1, 6 * len(station.stages) + len(flexes)).T


def drive_column(
    station: Station, along: tuple[tuple[str, float], ...], flexes: tuple[Flex, ...]
) -> Real:
    """Return the generalised force of a motor in all coordinates; (n,).

    With 1 along a single joint it is the row that reads the joint's coordinate, too.
    """
    forces, column = dict(along), np.zeros(6 * len(station.stages) + len(flexes))
    for index, stage in enumerate(station.stages):
        moving, _ = joint_rows(station, index, flexes)
        for joint, row in zip(stage.joints, moving, strict=True):
            column = column + forces.get(joint.name, 0.0) * row
    return column
