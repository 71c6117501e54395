r"""Inputs of the machine in time: what each of them applies to MuJoCo.

MuJoCo takes controls of actuators, generalised forces at joints, and wrenches at bodies' centres of
mass. A force at a point is a wrench at the centre of its stage, with the arm of the machine at
rest. An acceleration a of the floor is the inertia force -m a at every body, and the readings then
gain the floor's own motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import mujoco
import numpy as np

from identification.words import (
    JOINT_PREFIX,
    Dof,
    Input,
    Loop,
    Output,
    Real,
    Signal,
    UsageError,
    shorten_names,
)
from mbmodel.machine import Machine
from mbmodel.mjcf.names import actuator_name, joint_coordinate
from mbmodel.ports.ports import find_ports, parse_input
from mbmodel.ports.signal_rows import is_floor
from mbmodel.simulation.time_model import TimeModel

REFERENCE: Final = "reference"  # before the name of a loop: the label of its reference
_CONTROL, _JOINT_FORCE, _WRENCH = (
    mujoco.mjtState.mjSTATE_CTRL,
    mujoco.mjtState.mjSTATE_QFRC_APPLIED,
    mujoco.mjtState.mjSTATE_XFRC_APPLIED,
)
CONTROL_SPEC = int(_CONTROL) | int(_JOINT_FORCE) | int(_WRENCH)  # in this order in a vector


@dataclass(frozen=True)
class JointDof:
    """The coordinate of a slide or hinge, by the joint's name.

    Args:
        joint: name of the joint.
    """

    joint: str

    def __str__(self) -> str:
        """Return the label ``joint:<name>``."""
        return f"{JOINT_PREFIX}{self.joint}"


@dataclass(frozen=True)
class SensorValue:
    """One number of a MuJoCo sensor of the MJCF, by the sensor's name.

    Args:
        sensor: name of the sensor.
        number: of its numbers, from 0.
    """

    sensor: str
    number: int = 0

    def __str__(self) -> str:
        """Return the name, with the number behind a full stop unless it is the first."""
        return f"{self.sensor}.{self.number}" if self.number else self.sensor


@dataclass(frozen=True)
class LoopSignal:
    """A signal of a control loop, as an input.

    Args:
        loop: name of the loop.
        kind: its reference, the noise of its measurement, or a command that is added to its
            control before the limit.
    """

    loop: str
    kind: Literal["reference", "noise", "command"] = REFERENCE

    def __str__(self) -> str:
        """Return the label ``<kind>:<name>``."""
        return f"{self.kind}:{self.loop}"


Drive = Input | JointDof | LoopSignal
Reading = Dof | Signal | JointDof | SensorValue


def parse_drive(machine: Machine, text: str, loops: Sequence[Loop] = ()) -> Drive:
    """Return the motor, joint, direction or reference of a closed loop that a text names.

    Args:
        text: as for ``mbmodel.ports.ports.parse_input``, or ``reference:ty``.
        loops: that are closed.

    Raises:
        UsageError: it names none of these.
    """
    kind, _, name = text.partition(":")
    if kind == REFERENCE and name in [loop.name for loop in loops]:
        return LoopSignal(name)
    if kind == REFERENCE and kind not in (*machine.layout.points, *machine.layout.bodies):
        closed = ", ".join(loop.name for loop in loops) or "none"
        raise UsageError(
            f"{text!r}: no loop {name!r} is closed (there are {closed}): close it with --budget or "
            "--closed"
        )
    return _parse_joint(machine, text) or parse_input(machine, text)


def parse_reading(machine: Machine, text: str) -> Reading:
    """Return the joint, direction, pair or MuJoCo sensor whose values a text names.

    Args:
        text: ``joint:ty_tx``, ``coil-magnet:+tx``, a label such as ``acc11:+tx``, or the name of a
            sensor; ``imu.2`` is the third number of the sensor ``imu``.

    Raises:
        UsageError: it names none of these.
    """
    return _parse_joint(machine, text) or find_reading(machine.layout.parse(text))


def find_reading(port: Output) -> Reading:
    """Return the reading in time of an output of the linear model."""
    if isinstance(port, Dof) or port.is_directed:
        return port
    if port.is_joint:
        return JointDof(port.name.removeprefix(JOINT_PREFIX))
    name, _, number = port.name.rpartition(".")
    is_numbered = bool(name) and number.isdecimal()
    return SensorValue(name, int(number)) if is_numbered else SensorValue(port.name)


def _parse_joint(machine: Machine, text: str) -> JointDof | None:
    """Return the joint of a label ``joint:<name>``; None for other labels."""
    name = text.removeprefix(JOINT_PREFIX)
    if name == text:
        return None
    joints = [axle.joint for axle in machine.axles]
    if name not in joints:
        raise UsageError(
            f"{text!r}: {machine.source} has no slide or hinge of this name: choose one of "
            f"{shorten_names(joints)}"
        )
    return JointDof(name)


@dataclass(frozen=True, eq=False)
class Drives:
    """Gains from the inputs to MuJoCo's controls and to the floor.

    Args:
        gain: entries of the control vector per unit of each input; (n_control, n_in).
        floor: acceleration of the floor per unit of each input, in world axes; (3, n_in).
    """

    gain: Real
    floor: Real


def rest_controls(model: TimeModel) -> Real:
    """Return the control vector that keeps the machine in its state of rest; (n_control,)."""
    return np.concatenate([model.controls, model.holding, np.zeros(6 * model.compiled.nbody)])


def wrench_gain(model: TimeModel, wrenches: Real) -> Real:
    """Return the entries of the control vector for wrenches at the stages' centres of mass.

    Args:
        wrenches: force and moment at the centre of each stage; (6 n_stage, n_in).

    Returns:
        (n_control, n_in).
    """
    applied = np.zeros((model.compiled.nbody, 6, wrenches.shape[1]))
    parts = wrenches.reshape(-1, 6, wrenches.shape[1])
    for body, centre, part in zip(model.lead, model.machine.layout.centres, parts, strict=True):
        arm = centre - model.centres[body]
        applied[body, :3] = part[:3]
        applied[body, 3:] = part[3:] + np.cross(arm, part[:3], axisb=0, axisc=0)
    empty = np.zeros((len(model.controls) + len(model.holding), wrenches.shape[1]))
    return np.vstack([empty, applied.reshape(-1, wrenches.shape[1])])


def find_drives(model: TimeModel, inputs: Sequence[Drive]) -> Drives:
    """Return what each input applies; signals of loops apply nothing by themselves.

    Args:
        inputs: points, pairs of points, bodies, motors, joints, the floor, or signals of loops.

    Raises:
        UsageError: the machine has no such input, or the floor would turn.
    """
    machine = model.machine
    gain = np.zeros((len(rest_controls(model)), len(inputs)))
    floor = np.zeros((3, len(inputs)))
    for column, port in enumerate(inputs):
        if isinstance(port, LoopSignal):
            continue
        drive: Input | JointDof = port
        if isinstance(port, Signal) and port.is_joint:
            drive = JointDof(port.name.removeprefix(JOINT_PREFIX))
        if isinstance(drive, Signal) and not drive.is_directed:
            find_ports(machine, (), (drive,))  # refuses an unknown motor
            gain[_control_number(model, drive.name), column] = 1.0
        elif isinstance(drive, JointDof):
            gain[len(model.controls) + joint_coordinate(model.compiled, drive.joint), column] = 1.0
        else:
            ports = find_ports(machine, (), (drive,))
            if is_floor(machine, drive):
                if drive.is_rotation:
                    raise UsageError(
                        f"{drive}: a turning floor is not simulated: move it along tx, ty or tz"
                    )
                floor[drive.axis, column] = drive.sign
            wrench = ports.force - machine.body_mass @ ports.floor
            gain[:, column] += wrench_gain(model, wrench)[:, 0]
    return Drives(gain, floor)


def _control_number(model: TimeModel, name: str) -> int:
    """Return the place of a motor's control in the control vector."""
    compiled = model.compiled
    for actuator in range(compiled.nactuator):
        first = int(compiled.actuator_ctrladr[actuator])
        count = int(compiled.actuator_ctrlnum[actuator])
        base = actuator_name(compiled, actuator)
        names = [base] if count == 1 else [f"{base}.{k}" for k in range(count)]
        if name in names:
            return first + names.index(name)
    raise UsageError(f"{name!r} is no motor of the model")
