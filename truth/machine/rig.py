r"""A machine on test: what the hits move and what is recorded of it, whatever effects are in it.

    H(s) = s^2 D(s) L N [N^T (K + s C + s^2 M + sum_t z_t(s) a_t b_t^T) N]^-1 N^T P,  s = i omega

with N a basis of the null space of G (``dynamics``), L the sensors, P the hammers, z_t the
stiffness of what depends on frequency as no spring and damper does, D the sensors' own dynamics.
Each line is solved directly. What is nonlinear stays apart, in ``joints``.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np
import scipy.linalg

from truth.machine.couplings import coupled_matrices
from truth.machine.dynamics import (
    Equations,
    Flex,
    assemble,
    drive_column,
    hammer_columns,
    sensor_rows,
)
from truth.machine.springs import ClosedLoop
from truth.machine.station import Complex, Hammer, Real, StageBody, Station

Response = Callable[[Complex], Complex]


@dataclass(frozen=True)
class Occasion:
    """One hit of a campaign: what may differ between hits.

    Args:
        level: mean peak force of its test [N].
        node: measuring point that is hit.
        axis: 0, 1, 2 for the hit's direction.
        setup: of the sensors, such as ``a``; empty if there is one alone.
        time: when in its column of the test, from 0 to 1.
        label: reference as the user writes it; empty for ``acc<node>`` and its direction.
        visit: number of its visit to a level, from 0.
    """

    level: float = 200.0
    node: int = 0
    axis: int = 0
    setup: str = ""
    time: float = 0.0
    label: str = ""
    visit: int = 0

    @property
    def reference(self) -> str:
        """The test: reference and direction, such as ``acc11:+ty``."""
        return self.label or f"acc{self.node}:+t{'xyz'[self.axis]}"


@dataclass(frozen=True, eq=False)
class FrequencyLaw:
    """A stiffness that depends on frequency: force z(s) (row x) on the column.

    Args:
        row: b, what it feels; (n,).
        column: a, where it acts; (n,).
        stiffness: z of s.
    """

    row: Real
    column: Real
    stiffness: Response


@dataclass(frozen=True, eq=False)
class Filter:
    """What sensors do to their readings: factors of s on some outputs."""

    outputs: tuple[int, ...]
    response: Response


class Restoring(Protocol):
    """A nonlinear force beside the linear ones, which vanishes with the motion."""

    def start(self, count: int) -> Real:
        """Return the inner state at rest of so many machines at once; (count,)."""
        ...

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return force against the stretch, and the new state; (count,) each."""
        ...


class Memoryless:
    """Base of forces whose inner state at rest is 0, or that have none."""

    def start(self, count: int) -> Real:
        """Return zeros; (count,)."""
        return np.zeros(count)


@dataclass(frozen=True, eq=False)
class NonlinearJoint:
    """A restoring force that acts on a row of coordinates; (n,)."""

    row: Real
    law: Restoring


@dataclass(frozen=True, eq=False)
class Prepared:
    """A machine before its equations are written: stages, hammers, stages that bend."""

    station: Station
    hammers: tuple[Hammer, ...]
    flexes: tuple[Flex, ...] = ()

    def with_stage(self, index: int, stage: StageBody) -> "Prepared":
        """Return the machine with another stage at an index."""
        stages = list(self.station.stages)
        stages[index] = stage
        return replace(self, station=replace(self.station, stages=tuple(stages)))


@dataclass(frozen=True, eq=False)
class Rig:
    """A machine's equations with sensors and hammers.

    Args:
        equations: M, C, K, G of n coordinates.
        readout: L; (n_out, n).
        drive: P; (n, n_in).
        laws: stiffness that depends on frequency.
        filters: dynamics of sensors.
        joints: nonlinear forces.
    """

    equations: Equations
    readout: Real
    drive: Real
    laws: tuple[FrequencyLaw, ...] = ()
    filters: tuple[Filter, ...] = ()
    joints: tuple[NonlinearJoint, ...] = field(default=())

    def with_coordinate(self) -> "Rig":
        """Return the rig with one more coordinate at the end, not joined to anything."""
        return replace(
            self,
            equations=self.equations.with_coordinate(),
            readout=np.pad(self.readout, ((0, 0), (0, 1))),
            drive=np.pad(self.drive, ((0, 1), (0, 0))),
            laws=tuple(
                replace(law, row=np.pad(law.row, (0, 1)), column=np.pad(law.column, (0, 1)))
                for law in self.laws
            ),
            joints=tuple(replace(joint, row=np.pad(joint.row, (0, 1))) for joint in self.joints),
        )

    def with_matrices(
        self, mass: Real | float = 0.0, damping: Real | float = 0.0, stiffness: Real | float = 0.0
    ) -> "Rig":
        """Return the rig with matrices added; (n, n) each."""
        old = self.equations
        new = Equations(
            old.mass + mass, old.damping + damping, old.stiffness + stiffness, old.rigid
        )
        return replace(self, equations=new)


def build(tested: Prepared) -> Rig:
    """Write the equations of a machine with its sensors and hammers."""
    station, flexes = tested.station, tested.flexes
    plain, added = assemble(station, flexes), coupled_matrices(station, flexes)
    return Rig(
        Equations(
            plain.mass + added.mass,
            plain.damping + added.damping,
            plain.stiffness + added.stiffness,
            plain.rigid,
        ),
        sensor_rows(station, flexes),
        hammer_columns(station, tested.hammers, flexes),
        laws=tuple(close_loop(tested, loop) for loop in station.loops),
        filters=tuple(
            Filter((3 * number + axis,), partial(respond_late, float(sensor.delay[axis])))
            for number, (_, sensor) in enumerate(station.sensors())
            for axis in range(3)
            if sensor.delay[axis]
        ),
    )


def close_loop(tested: Prepared, loop: ClosedLoop) -> FrequencyLaw:
    """Return a control loop as a stiffness between what it reads and what it drives."""
    station, flexes = tested.station, tested.flexes
    drives = {motor.name: motor.along for motor in station.motors}
    column = drive_column(station, drives[loop.motor], flexes)
    return FrequencyLaw(drive_column(station, ((loop.joint, 1.0),), flexes), column, loop.stiffness)


def respond_late(delay: float, s: Complex) -> Complex:
    """Return exp(-s tau), the response of readings that come late by tau [s]; like s."""
    return np.asarray(np.exp(-s * delay), np.complex128)


def null_basis(equations: Equations) -> Real:
    """Return coordinates in which the rigid directions are kept: x = N y; (n, n - m)."""
    if not len(equations.rigid):
        return np.eye(len(equations.mass))
    return np.asarray(scipy.linalg.null_space(equations.rigid), np.float64)


def dynamic_stiffness(rig: Rig, freq_hz: Real) -> tuple[Complex, Real]:
    """Return N^T Z N at each line, (n_freq, n - m, n - m), and N."""
    basis, equations = null_basis(rig.equations), rig.equations
    mass, damping, stiffness = (
        basis.T @ matrix @ basis
        for matrix in (equations.mass, equations.damping, equations.stiffness)
    )
    s: Complex = (2j * np.pi * freq_hz[:, None, None]).astype(np.complex128)
    matrix: Complex = s**2 * mass + s * damping + stiffness
    for law in rig.laws:
        values = law.stiffness(s[:, 0, 0])
        matrix += values[:, None, None] * np.outer(basis.T @ law.column, law.row @ basis)
    return matrix, basis


def receptance(rig: Rig, freq_hz: Real, columns: Real) -> Complex:
    """Coordinates' motion per unit of generalised forces; (n_freq, n, n_columns)."""
    matrix, basis = dynamic_stiffness(rig, freq_hz)
    return np.asarray(basis @ np.linalg.solve(matrix, (basis.T @ columns)[None]))


def read_accelerations(rig: Rig, motion: Complex, freq_hz: Real) -> Complex:
    """Accelerations recorded of the coordinates' motion (n_freq, n, k); (n_freq, n_out, k)."""
    s: Complex = (2j * np.pi * freq_hz).astype(np.complex128)
    reading: Complex = s[:, None, None] ** 2 * (rig.readout @ motion)
    for sensor_filter in rig.filters:
        reading[:, list(sensor_filter.outputs)] *= sensor_filter.response(s)[:, None, None]
    return reading


def accelerance(rig: Rig, freq_hz: Real) -> Complex:
    """Return the accelerations that are recorded per unit force of the hammers.

    Args:
        rig: machine, sensors and hammers.
        freq_hz: frequencies [Hz]; (n_freq,).

    Returns:
        H [m/s2/N]; (n_freq, n_out, n_in), sensors in the station's order; zero at 0 Hz.
    """
    values = np.zeros((freq_hz.size, len(rig.readout), rig.drive.shape[1]), dtype=np.complex128)
    moving = freq_hz > 0
    lines = freq_hz[moving]
    values[moving] = read_accelerations(rig, receptance(rig, lines, rig.drive), lines)
    return values
