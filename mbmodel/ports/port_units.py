"""Units of ports: what an output reads, and what one unit of an input is."""

from collections.abc import Sequence

from identification.words import Input, Output, Quantity, Signal
from mbmodel.machine import Machine
from mbmodel.ports.signal_rows import find_sensor, is_floor, turns

CONTROL = "control"  # the unit of a motor's control, which an MJCF does not state
_MOTION_UNITS: dict[Quantity, tuple[str, str]] = {  # along and about an axis
    "receptance": ("m", "rad"),
    "mobility": ("m/s", "rad/s"),
    "accelerance": ("m/s²", "rad/s²"),
}


def usual_quantity(outputs: Sequence[Output]) -> Quantity:
    """Return the quantity that is meant where none is stated.

    Args:
        outputs: of a request.

    Returns:
        receptance where all are joints or sensors of the MJCF, as encoders read positions; else
        accelerance.
    """
    read = [isinstance(port, Signal) and not port.is_directed for port in outputs]
    return "receptance" if read and all(read) else "accelerance"


def output_unit(machine: Machine, port: Output, quantity: Quantity) -> str:
    """Return the unit of an output: that of the quantity, but a MuJoCo sensor has its own.

    Args:
        machine: with the sensor or joint.
        port: the output.
        quantity: of the request.

    Raises:
        UsageError: a joint or sensor that the machine does not have.
    """
    if isinstance(port, Signal) and not (port.is_joint or port.is_directed):
        return find_sensor(machine, port).unit
    return _MOTION_UNITS[quantity][turns(machine, port)]


def input_unit(machine: Machine, port: Input) -> str:
    """Return the unit of an input: N or N m, an acceleration of the floor, or a control.

    Args:
        machine: with the joint or motor.
        port: the input.

    Raises:
        UsageError: a joint that the machine does not have.
    """
    if is_floor(machine, port):
        return _MOTION_UNITS["accelerance"][port.is_rotation]
    if isinstance(port, Signal) and not (port.is_joint or port.is_directed):
        return CONTROL
    return "N m" if turns(machine, port) else "N"
