"""Control loops of campaign.toml and budget.toml, for the ports of a machine.

Their controllers come from the file, or are objects of python-control.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.readers.controller import MIN_PERIOD_S, LoopTable, find_controller, stated_delay
from identification.words import (
    DERIVATIVE_ORDER,
    Controller,
    Input,
    InputError,
    Loop,
    Output,
    PortSum,
    Quantity,
    Signal,
    UsageError,
)
from mbmodel import Machine, input_unit, output_unit, parse_input, parse_output
from mbmodel.ports.signal_rows import is_floor


def read_loops(
    path: Path,
    machine: Machine,
    tables: Mapping[str, LoopTable],
    controllers: Mapping[str, Any] | None = None,
) -> tuple[Loop, ...]:
    """Return the loops of a file for a machine.

    Args:
        path: of the file; controllers that it names lie beside it.
        machine: with the labels of inputs and outputs.
        tables: ``[loop.NAME]`` by name.
        controllers: python-control objects that replace those of the file, by the loop's name.

    Raises:
        InputError: a port that the machine does not have, or a controller that cannot be read.
        UsageError: a python-control object that is no controller.
    """
    return tuple(
        _read_loop(path, machine, name, table, (controllers or {}).get(name))
        for name, table in tables.items()
    )


def _read_loop(
    path: Path, machine: Machine, name: str, table: LoopTable, system: Any | None
) -> Loop:
    """Return a loop; a python-control object replaces the file's controller."""
    key = f"loop.{name}"
    port = read_input(path, machine, key, table.input)
    if is_floor(machine, port):
        raise InputError(f"{path}: {key} drives the floor: name a motor or a force as input")
    measured = read_port_sum(path, machine, key, (table.output, table.minus), table.quantity)
    controller = find_controller(path, key, table.controller) if system is None else None
    return Loop(
        name,
        port,
        measured,
        controller_from_system(system) if controller is None else controller,
        input_unit(machine, port),
        table.delay,
        table.resolution,
        table.quantisation,
        table.limit,
    )


def read_port_sum(
    path: Path,
    machine: Machine,
    key: str,
    texts: tuple[str, str | None],
    quantity: Quantity = "receptance",
) -> PortSum:
    """Return an output, or the difference of two.

    Args:
        machine: with the outputs.
        key: of the table, such as ``loop.ty``; what follows the dot is the signal's name.
        texts: label of the output, and of the one to subtract or None.
        quantity: of motions.

    Raises:
        InputError: an output that the machine does not have, or two of different units.
    """
    output, minus = texts
    terms = [(_read_output(path, machine, key, output), 1.0)]
    if minus is not None:
        terms.append((_read_output(path, machine, key, minus), -1.0))
    units = [output_unit(machine, port, quantity) for port, _ in terms]
    if len(set(units)) > 1:
        raise InputError(
            f"{path}: {key} subtracts {minus} [{units[1]}] from {output} [{units[0]}]: "
            "name two outputs of one unit"
        )
    is_sensor = [
        isinstance(port, Signal) and not (port.is_joint or port.is_directed) for port, _ in terms
    ]
    derivative = 0 if any(is_sensor) else DERIVATIVE_ORDER[quantity]
    if derivative == 0 and len(set(is_sensor)) > 1 and units[0] not in ("m", "rad"):
        raise InputError(f"{path}: {key}: name two sensors, or two outputs without sensors")
    return PortSum(key.partition(".")[2], tuple(terms), units[0], derivative)


def read_input(path: Path, machine: Machine, key: str, text: str) -> Input:
    """Return an input of the machine.

    Raises:
        InputError: the machine does not have it.
    """
    try:
        return parse_input(machine, text)
    except (UsageError, ValueError) as error:
        raise InputError(f"{path}: {key}: {error}") from error


def _read_output(path: Path, machine: Machine, key: str, text: str) -> Output:
    """Return an output of the machine."""
    try:
        return parse_output(machine, text)
    except (UsageError, ValueError) as error:
        raise InputError(f"{path}: {key}: {error}") from error


def controller_from_system(system: Any) -> Controller:
    """Return the controller that a python-control object is.

    Args:
        system: state space or transfer function of one input and one output, or a number.

    Raises:
        UsageError: it is no linear system of one input and one output, has a delay, or is sampled
            with a period that is not known.
    """
    import control  # noqa: PLC0415  # with its matplotlib it would add 0.7 s to every start
    import scipy.signal  # noqa: PLC0415  # slow to load

    if isinstance(system, Controller):
        return system
    try:
        is_number = isinstance(system, int | float)
        converted = control.ss(control.tf([system], [1]) if is_number else system)
    except Exception as error:
        raise UsageError(
            f"{type(system).__name__} is no linear controller ({error}): give a state space or a "
            "transfer function of python-control"
        ) from error
    if converted.ninputs != 1 or converted.noutputs != 1:
        raise UsageError(
            f"the controller has {converted.noutputs} x {converted.ninputs} channels: give each "
            "loop a controller with one input and one output"
        )
    period = 0.0 if converted.dt is None else converted.dt
    if period is True or not (period == 0 or MIN_PERIOD_S <= period <= 1):
        raise UsageError(
            f"the controller is discrete with the step {converted.dt}: give its sampling period as "
            f"dt, from {MIN_PERIOD_S:g} s to 1 s"
        )
    late = stated_delay(getattr(system, "__dict__", {}))
    if late:
        raise UsageError(f"the controller: {late}")
    matrices = converted.A, converted.B, converted.C, converted.D
    if isinstance(system, control.TransferFunction):
        fraction = np.ravel(system.num[0][0]), np.ravel(system.den[0][0])
        if len(np.trim_zeros(fraction[1], "f")) - 1 > len(converted.A):
            # The conversion cancelled a pole that the controller has, and that may grow.
            matrices = scipy.signal.tf2ss(*fraction)
    states, entry, output, through = (np.asarray(matrix, float) for matrix in matrices)
    return Controller(states, entry, output, through, float(period))
