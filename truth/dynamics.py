r"""Equations of motion in absolute coordinates, and the accelerance that follows from them.

Each stage has six coordinates: the translation u of its centre of mass and its small rotation
theta, in world axes. A point at r from the centre of mass moves by u + theta x r. Then

    M x'' + C x' + K x = f,   G x = 0

with M = blkdiag(m 1, I), a spring k and a damper c for each joint, and one row of G for each
direction in which a stage is rigid against its parent. Time convention exp(+i omega t).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from truth.errors import TruthError
from truth.station import GROUND, Complex, Hammer, Real, Stage, Station


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


def assemble(station: Station) -> Equations:
    """Assemble the station's equations of motion, rigid directions still as constraints."""
    n = 6 * len(station.stages)
    mass, damping, stiffness = np.zeros((3, n, n))
    rigid: list[Real] = [np.zeros((0, n))]
    for index, stage in enumerate(station.stages):
        here = slice(6 * index, 6 * index + 6)
        mass[here, here] = scipy.linalg.block_diag(stage.mass * np.eye(3), stage.inertia)
        moving, fixed = _joint_rows(station, index)
        stiffness += (moving.T * [joint.stiffness for joint in stage.joints]) @ moving
        damping += (moving.T * [joint.damping for joint in stage.joints]) @ moving
        rigid.append(fixed)
    return Equations(mass, damping, stiffness, np.vstack(rigid))


def point_row(stage: Stage, position: Real, direction: Real) -> Real:
    """Return the row d such that d x is the motion of a point of the stage along a direction.

    Its transpose is the generalised force of a unit force there; (6,), the stage's coordinates.
    """
    return np.concatenate([direction, np.cross(position - stage.com, direction)])


def accelerance(
    station: Station, equations: Equations, hammers: tuple[Hammer, ...], freq_hz: Real
) -> Complex:
    r"""Accelerations that the sensors read per unit force of the hammers.

    H(omega) = -omega^2 L N [N^T (K - omega^2 M + i omega C) N]^-1 N^T P, N a basis of the null
    space of G: a direct solution at each line. The line at 0 Hz is zero.

    Args:
        station: places, axes and gains of the sensors.
        equations: of the same station, effects included.
        hammers: one for each column.
        freq_hz: frequencies [Hz]; (n_freq,).

    Returns:
        H [m/s2/N]; (n_freq, 3 n_sensors, n_hammers), sensors in the station's order.
    """
    basis = scipy.linalg.null_space(equations.rigid) if len(equations.rigid) else None
    M, C, K = (
        matrix if basis is None else basis.T @ matrix @ basis
        for matrix in (equations.mass, equations.damping, equations.stiffness)
    )
    L = _sensor_rows(station, equations.mass.shape[0])
    P = _hammer_columns(station, hammers, equations.mass.shape[0])
    if basis is not None:
        L, P = L @ basis, basis.T @ P
    H = np.zeros((freq_hz.size, L.shape[0], P.shape[1]), dtype=np.complex128)
    moving = freq_hz > 0
    omega = 2 * np.pi * freq_hz[moving, None, None]
    H[moving] = -(omega**2) * (L @ np.linalg.solve(K - omega**2 * M + 1j * omega * C, P[None]))
    return H


def _joint_rows(station: Station, index: int) -> tuple[Real, Real]:
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
    relative = np.zeros((6, 6 * len(station.stages)))
    relative[:, 6 * index : 6 * index + 6] = _motion_at(stage, point)
    if stage.parent != GROUND:
        parent = slice(6 * stage.parent, 6 * stage.parent + 6)
        relative[:, parent] = -_motion_at(station.stages[stage.parent], point)
    orthogonal = np.linalg.qr(S, mode="complete")[0][:, S.shape[1] :]
    moving = np.linalg.pinv(S) @ relative if stage.joints else np.zeros((0, relative.shape[1]))
    return moving, orthogonal.T @ relative


def _motion_at(stage: Stage, point: Real) -> Real:
    """Return translation of a point and rotation, from the stage's six coordinates; (6, 6)."""
    motion = np.eye(6)
    motion[:3] = [point_row(stage, point, axis) for axis in np.eye(3)]
    return motion


def _sensor_rows(station: Station, n: int) -> Real:
    rows = []
    for index, sensor in station.sensors():
        for axis, gain in zip(sensor.axes, sensor.gain, strict=True):
            row = np.zeros(n)
            place = slice(6 * index, 6 * index + 6)
            row[place] = gain * point_row(station.stages[index], sensor.position, axis)
            rows.append(row)
    return np.array(rows).reshape(-1, n)


def _hammer_columns(station: Station, hammers: tuple[Hammer, ...], n: int) -> Real:
    columns = np.zeros((n, len(hammers)))
    for column, hammer in enumerate(hammers):
        place = slice(6 * hammer.stage, 6 * hammer.stage + 6)
        stage = station.stages[hammer.stage]
        columns[place, column] = point_row(stage, hammer.position, hammer.direction)
    return columns
