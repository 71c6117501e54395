"""Units of inputs and outputs of a simulation in time."""

from collections.abc import Sequence

from identification.words import Loop, Quantity, Real, Signal
from mbmodel import Machine
from mbmodel.ports.signal_rows import is_floor
from mbmodel.simulation.closed_loops import LoopRecord
from mbmodel.simulation.drives import (
    REFERENCE,
    Drive,
    JointDof,
    LoopSignal,
    Reading,
    SensorValue,
)
from mbw.page.numbers import MOTION_UNITS


def loop_columns(loops: Sequence[LoopRecord]) -> list[tuple[str, str, Real]]:
    """Return label, unit and values of the signals of closed loops."""
    return [
        (f"{label}:{record.loop.name}", unit, values)
        for record in loops
        for label, unit, values in (
            (REFERENCE, record.loop.measured.unit, record.reference),
            ("measured", record.loop.measured.unit, record.measured),
            ("control", record.loop.input_unit, record.control),
        )
    ]


def input_unit(machine: Machine, drive: Drive, loops: Sequence[Loop]) -> str:
    """Return the unit of an input; the reference of a loop has that of what it measures."""
    if isinstance(drive, LoopSignal):
        return next(loop.measured.unit for loop in loops if loop.name == drive.loop)
    if isinstance(drive, Signal) and not drive.is_directed:
        return "control"
    if isinstance(drive, JointDof):
        return "N m" if _turns(machine, drive) else "N"
    if is_floor(machine, drive):
        return MOTION_UNITS["accelerance"][drive.is_rotation]
    return "N m" if drive.is_rotation else "N"


def output_unit(machine: Machine, reading: Reading, quantity: Quantity) -> str:
    """Return the unit of an output: a joint gives its position, a sensor what MuJoCo defines.

    A sensor that has no linear model, such as a rangefinder, gives ``sensor``.
    """
    if isinstance(reading, SensorValue):
        linear_reading = machine.sensors.readings.get(str(reading))
        return "sensor" if linear_reading is None else linear_reading.unit
    if isinstance(reading, JointDof):
        return "rad" if _turns(machine, reading) else "m"
    return MOTION_UNITS[quantity][reading.is_rotation]


def _turns(machine: Machine, dof: JointDof) -> bool:
    return next(axle.turns for axle in machine.axles if axle.joint == dof.joint)
