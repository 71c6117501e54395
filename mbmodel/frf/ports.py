"""What the inputs do to a machine and what the outputs read of it, by label."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Dof, Input, Motor, Real, UsageError
from mbmodel.linearisation.motors import Drive
from mbmodel.machine import Machine
from mbmodel.parts import Change

FLOOR = "floor"


@dataclass(frozen=True, eq=False)
class Places:
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


def places(machine: Machine, outputs: Sequence[Dof], inputs: Sequence[Input]) -> Places:
    """Look labels up.

    Raises:
        UsageError: a label or motor that the machine does not have; a floor that tilts under
            gravity.
    """
    size, count = len(machine.body_mass), len(inputs)
    force, floor = np.zeros((size, count)), np.zeros((size, count))
    motor = np.zeros((len(machine.coordinates), count))
    for column, dof in enumerate(inputs):
        if isinstance(dof, Motor):
            drive = _motor(machine, dof)
            motor[:, column], force[:, column] = drive.joint, drive.body
        elif is_floor(machine, dof):
            _refuse_tilt(machine, dof)
            floor[:, column] = dof.sign * machine.floor[:, dof.axis]
        else:
            force[:, column] = machine.layout.rows([dof])[0]
    return Places(machine.layout.rows(outputs), force, motor, floor)


def is_floor(machine: Machine, dof: Dof) -> bool:
    """Whether a label means the floor: no body and no point of the machine bears that name."""
    layout = machine.layout
    return dof.point == FLOOR and FLOOR not in layout.points + layout.bodies


def _motor(machine: Machine, motor: Motor) -> Drive:
    if motor.name not in machine.motors:
        known = ", ".join(machine.motors) or "none"
        raise UsageError(f"{motor.name!r} is no motor of the model: there are {known}")
    return machine.motors[motor.name]


def _refuse_tilt(machine: Machine, dof: Dof) -> None:
    if dof.is_rotation and (machine.gravity.any() or machine.spinning):
        raise UsageError(
            f"{dof}: a floor that tilts also turns the machine's weight and rotors, which is not "
            "handled: turn gravity and spin off, or ask for translations of the floor"
        )


def parse_input(machine: Machine, text: str) -> Input:
    """Read a label, or the name of a motor.

    Raises:
        UsageError: neither of both.
    """
    return Motor(text) if text in machine.motors and ":" not in text else Dof.parse(text)


def selection(dofs: Sequence[Input], point: str) -> Real:
    """Which labels mean which direction of a point, with their signs; (n, 6)."""
    chosen = np.zeros((len(dofs), 6))
    for row, dof in zip(chosen, dofs, strict=True):
        if isinstance(dof, Dof) and dof.point == point:
            row[dof.axis] = dof.sign
    return chosen


def changed(
    places: Places, changes: Sequence[Change], outputs: Sequence[Dof], inputs: Sequence[Input]
) -> Places:
    """The same with what Parts add at sensors and hammer."""
    if not changes:
        return places
    readout, force = places.readout.copy(), places.force.copy()
    for change in changes:
        added = change.left @ change.core[0] @ change.right.T
        if change.slot == "sensor":
            readout += selection(outputs, change.point) @ added
        else:
            force += (selection(inputs, change.point) @ added).T
    return Places(readout, force, places.motor, places.floor)
