"""Control loops of campaign.toml and budget.toml, for the ports of a machine."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from identification.readers.controller import find_controller
from identification.readers.loop_toml import LoopTable
from identification.words import (
    DERIVATIVE_ORDER,
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
from tuning.control_loops.controller import controller_from_system


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
        path: of the file, for messages.
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
