"""Ports of a model: forces of the inputs on the machine, and readout of the outputs, by label."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Dof, Input, Motor, Real, UsageError
from mbmodel.linearisation.motors import ActuatorGain
from mbmodel.machine import Machine
from mbmodel.parts import Change

FLOOR = "floor"  # the point of labels for motions of the floor


@dataclass(frozen=True, eq=False)
class Ports:
    """Rows of the outputs and columns of the inputs.

    Args:
        readout: L, output per motion of the centres of mass; (n_out, 6 n_body).
        force: P, forces at the centres per unit of each input; (6 n_body, n_in).
        motor: generalised forces per unit of each input; (nv, n_in).
        floor: U, acceleration of the centres with the floor, per unit of each input;
            (6 n_body, n_in).
    """

    readout: Real
    force: Real
    motor: Real
    floor: Real

    @property
    def has_floor(self) -> bool:
        """Whether some input moves the floor."""
        return bool(self.floor.any())


def find_ports(machine: Machine, outputs: Sequence[Dof], inputs: Sequence[Input]) -> Ports:
    """Return the ports of a machine for labels.

    Args:
        machine: as drawn.
        outputs: labels of sensors, points or bodies.
        inputs: labels of points or bodies, of the floor, or motors.

    Raises:
        UsageError: a label or motor that the machine does not have; a floor that tilts under
            gravity.
    """
    size, count = len(machine.body_mass), len(inputs)
    force, floor = np.zeros((size, count)), np.zeros((size, count))
    motor = np.zeros((len(machine.coordinates), count))
    for column, dof in enumerate(inputs):
        if isinstance(dof, Motor):
            gain = _motor(machine, dof)
            motor[:, column], force[:, column] = gain.joint, gain.body
        elif is_floor(machine, dof):
            _refuse_tilt(machine, dof)
            floor[:, column] = dof.sign * machine.floor_jacobian[:, dof.axis]
        else:
            force[:, column] = machine.layout.rows([dof])[0]
    return Ports(machine.layout.rows(outputs), force, motor, floor)


def is_floor(machine: Machine, dof: Dof) -> bool:
    """Return whether a label means the floor: no body and no point has the name ``floor``."""
    layout = machine.layout
    return dof.point == FLOOR and FLOOR not in layout.points + layout.bodies


def _motor(machine: Machine, motor: Motor) -> ActuatorGain:
    """Return the gain of a motor."""
    if motor.name not in machine.motors:
        names = ", ".join(machine.motors) or "none"
        raise UsageError(f"{motor.name!r} is no motor of the model: choose one of {names}")
    return machine.motors[motor.name]


def _refuse_tilt(machine: Machine, dof: Dof) -> None:
    """Raise UsageError for a tilting floor if gravity is on or a rotor spins."""
    if dof.is_rotation and (machine.gravity.any() or machine.spinning):
        raise UsageError(
            f"{dof}: a tilting floor also turns the machine's weight and rotors, which is not "
            "handled: turn gravity and spin off, or request translations of the floor"
        )


def parse_input(machine: Machine, text: str) -> Input:
    """Return the motor or the direction that a text names.

    Args:
        machine: with its motors.
        text: name of a motor, or a label such as ``acc11:+tx``.

    Raises:
        UsageError: the text is neither.
    """
    return Motor(text) if text in machine.motors and ":" not in text else Dof.parse(text)


def direction_selection(dofs: Sequence[Input], point: str) -> Real:
    """Return the signed direction of a point that each label means; (n, 6).

    Args:
        dofs: labels.
        point: name of the point; rows of labels at other points are zero.
    """
    matrix = np.zeros((len(dofs), 6))
    for row, dof in zip(matrix, dofs, strict=True):
        if isinstance(dof, Dof) and dof.point == point:
            row[dof.axis] = dof.sign
    return matrix


def apply_point_changes(
    ports: Ports, changes: Sequence[Change], outputs: Sequence[Dof], inputs: Sequence[Input]
) -> Ports:
    """Return ports with the changes of Parts at sensors and hammer points.

    Args:
        ports: as drawn.
        changes: in the slots sensor and hammer.
        outputs: labels of the outputs.
        inputs: labels of the inputs.
    """
    if not changes:
        return ports
    readout, force = ports.readout.copy(), ports.force.copy()
    for change in changes:
        added = change.left @ change.core[0] @ change.right.T
        if change.slot == "sensor":
            readout += direction_selection(outputs, change.point) @ added
        else:
            force += (direction_selection(inputs, change.point) @ added).T
    return Ports(readout, force, ports.motor, ports.floor)
