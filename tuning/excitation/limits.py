r"""Limits of drives as limits on signals: force, current, stroke and speed per unit of each input.

A drive is a motor, a joint, a pair of forces or a force at a point. Its motion is that of the joint
on which the motor acts most, or of the place and direction of the force itself. In closed loops the
signal r is added to the controller's output, so that the drive gives

    u = r - K(s) exp(-s tau) y.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    JOINT_PREFIX,
    Complex,
    Input,
    Output,
    Real,
    Signal,
    UsageError,
)
from mbmodel import Evaluator, FrfRequest, Model, input_unit, output_unit
from mbmodel.control_loops.loop_law import LoopLaw
from mbmodel.machine import Machine
from mbmodel.ports.ports import find_ports
from mbmodel.ports.signal_rows import is_floor

LIMITED = ("force", "current", "stroke", "speed")
_QUANTITY_READ = {order: quantity for quantity, order in DERIVATIVE_ORDER.items()}


@dataclass(frozen=True)
class DriveLimits:
    """Largest values of a drive, about rest; None for no limit.

    Args:
        force: of the drive [N, N m].
        current: [A].
        stroke: of its motion, to either side [m, rad].
        speed: of its motion [m/s, rad/s].
        motor_constant: force per current [N/A, N m/A]; None if no current is limited.
        at: label of the position that stroke and speed limit; None for the drive's own.
    """

    force: float | None = None
    current: float | None = None
    stroke: float | None = None
    speed: float | None = None
    motor_constant: float | None = None
    at: str | None = None


@dataclass(frozen=True, eq=False)
class LimitedSignal:
    """A signal that must stay below a limit.

    Args:
        drive: input whose limit it is.
        what: ``force``, ``current``, ``stroke`` or ``speed``.
        limit: largest value [unit].
        unit: unit of the limit.
        response: signal per unit of each input; (n_freq, n_drive).
    """

    drive: Input
    what: str
    limit: float
    unit: str
    response: Complex


def force_per_unit(machine: Machine, drive: Input) -> tuple[float, str]:
    """Return the force of a drive per unit of its input, with its unit N or N m.

    Args:
        machine: with its motors.

    Raises:
        UsageError: the floor, whose motion is no drive, or a motor without force.
    """
    if is_floor(machine, drive):
        raise UsageError(f"{drive}: the floor is no drive: name a motor, a joint or a force")
    if input_unit(machine, drive) != "control":
        return 1.0, input_unit(machine, drive)
    gain = machine.motors[str(drive)]
    if driven := machine.driven_axle(str(drive)):
        axle, force = driven
        return abs(force), "N m" if axle.turns else "N"
    if gain.joint.any():
        return float(np.abs(gain.joint).max()), "N"
    wrench = gain.body.reshape(-1, 6)
    forces, moments = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2).max(axis=0)
    if not max(forces, moments):
        raise UsageError(f"{drive} exerts no force at rest: name another drive")
    return (float(forces), "N") if forces else (float(moments), "N m")


def motion_of(machine: Machine, drive: Input, at: str | None = None) -> Output:
    """Return the position that a drive moves.

    Args:
        at: label of another position; None for the drive's own.

    Raises:
        UsageError: a label that is no position, or a motor that acts on no joint.
    """
    if at is not None:
        output = machine.layout.parse(at)
        unit = output_unit(machine, output, "receptance")
        if unit not in ("m", "rad"):
            raise UsageError(f"{at} reads {unit}, and stroke needs a position: name an encoder")
        return output
    if input_unit(machine, drive) != "control":
        return drive
    if not (driven := machine.driven_axle(str(drive))):
        raise UsageError(
            f"{drive} acts at a site or tendon: state in its limits where its stroke is read, such "
            'as at = "encoder"'
        )
    return Signal(JOINT_PREFIX + driven[0].joint)


def limited_signals(
    model: Model, theta: Real, freq_hz: Real, limits: Mapping[Input, DriveLimits]
) -> list[LimitedSignal]:
    """Return the signals that the limits of all drives bound.

    Args:
        model: machine, with its loops closed.
        theta: parameters [SI]; (n_parameter,).
        freq_hz: lines [Hz]; (n_freq,).
        limits: limits of each drive, in the order of the inputs.

    Raises:
        UsageError: a drive without a limit, or a limit that is not above 0.
    """
    machine, drives = model.machine, tuple(limits)
    signals = []
    for number, (drive, stated) in enumerate(limits.items()):
        _check(drive, stated)
        per_unit, unit = force_per_unit(machine, drive)
        command = drive_command(model, theta, freq_hz, drives, number)
        lags = find_ports(machine, (), (drive,)).lags(np.asarray(2j * np.pi * freq_hz, complex))
        command = command if lags is None else command * lags[0][:, None]
        if stated.force is not None:
            signals.append(LimitedSignal(drive, "force", stated.force, unit, per_unit * command))
        if stated.current is not None and stated.motor_constant is not None:
            response = per_unit / stated.motor_constant * command
            signals.append(LimitedSignal(drive, "current", stated.current, "A", response))
        if stated.stroke is None and stated.speed is None:
            continue
        place = motion_of(machine, drive, stated.at)
        moved = _responses(model, theta, freq_hz, (place,), drives, 0)[:, 0]
        unit = output_unit(machine, place, "receptance")
        if stated.stroke is not None:
            signals.append(LimitedSignal(drive, "stroke", stated.stroke, unit, moved))
        if stated.speed is not None:
            rates = 2j * np.pi * freq_hz[:, None] * moved
            signals.append(LimitedSignal(drive, "speed", stated.speed, f"{unit}/s", rates))
    return signals


def drive_command(
    model: Model, theta: Real, freq_hz: Real, drives: Sequence[Input], number: int
) -> Complex:
    """Return the total command of a drive per signal that is added to each; (n_freq, n_drive).

    Args:
        model, theta [SI] (n_parameter,), freq_hz [Hz] (n_freq,): as for ``limited_signals``.
        drives: inputs to which signals are added.
        number: number of the drive.
    """
    command = np.zeros((len(freq_hz), len(drives)), np.complex128)
    command[:, number] = 1.0
    for loop in model.machine.loops:
        if loop.input != drives[number]:
            continue
        ports, weights = zip(*loop.measured.terms, strict=True)
        order = loop.measured.derivative
        read = _responses(model, theta, freq_hz, ports, drives, order)
        laplace = np.asarray(2j * np.pi * freq_hz, np.complex128)
        law = LoopLaw(loop.controller, loop.delay)(laplace)
        command -= law[:, None] * np.einsum("o,foi->fi", np.array(weights), read)
    return command


def _responses(
    model: Model,
    theta: Real,
    freq_hz: Real,
    outputs: Sequence[Output],
    drives: Sequence[Input],
    order: int,
) -> Complex:
    """Return FRFs of a derivative of motions; (n_freq, n_out, n_drive)."""
    request = FrfRequest(freq_hz, tuple(outputs), tuple(drives), _QUANTITY_READ[order])
    return Evaluator(model, request).at(theta).values


def _check(drive: Input, stated: DriveLimits) -> None:
    """Refuse limits that are none."""
    values = {name: getattr(stated, name) for name in (*LIMITED, "motor_constant")}
    for name, value in values.items():
        if value is not None and not (np.isfinite(value) and value > 0):
            raise UsageError(f"{name} of {drive} is {value:g}: give a number above 0")
    if (stated.current is None) != (stated.motor_constant is None):
        raise UsageError(
            f"{drive}: current and motor_constant belong together: state both, in A and N/A (N m/A)"
        )
    if stated.at is not None and stated.stroke is None and stated.speed is None:
        raise UsageError(
            f"{drive}: at = {stated.at!r} is where stroke and speed are read, and neither is "
            "limited: state one of them, or remove at"
        )
    if not any(values[name] is not None for name in LIMITED):
        raise UsageError(f"{drive} has no limit: state one of {', '.join(LIMITED)}")
