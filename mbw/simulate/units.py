"""Units of inputs and outputs of a simulation in time."""

from identification.words import Input, Quantity, Signal
from mbmodel import Machine
from mbmodel.ports.signal_rows import is_floor
from mbmodel.simulation.drives import JointDof, Reading, SensorValue
from mbw.page.numbers import MOTION_UNITS


def input_unit(machine: Machine, drive: Input | JointDof) -> str:
    """Return the unit of an input."""
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
