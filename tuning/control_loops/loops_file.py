"""The control loops of a campaign beside its tuned MJCF, which cannot hold them: loops.json."""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from identification.readers.campaign_toml import read_settings
from identification.readers.result_files import ResultFile, read_result_json
from identification.words import Controller, InputError, Loop, PortSum, UsageError, parse_port
from mbmodel import Machine
from tuning.control_loops.read_loops import read_loops

LOOPS_JSON = "loops.json"


class LoopRow(BaseModel):
    """A control loop u = -K exp(-s tau) y; the controller K by its state space.

    ``period`` is its sampling period [s], 0 for a continuous one.
    """

    model_config = ConfigDict(extra="forbid")

    name: str
    input: str
    input_unit: str
    outputs: list[str]
    weights: list[float]
    output_unit: str
    derivative: int
    delay: float
    A: list[list[float]]
    B: list[list[float]]
    C: list[list[float]]
    D: list[list[float]]
    period: float = 0.0
    resolution: float = 0.0
    quantisation: float = 0.0
    limit: float | None = None


class LoopsFile(ResultFile):
    """Content of loops.json: the loops that were closed during the test."""

    model_config = ConfigDict(extra="forbid")

    loops: list[LoopRow]


def write_loops(loops: Sequence[Loop], file: Path) -> None:
    """Write loops.json; no file without any loop.

    Args:
        loops: that were closed during the test.
    """
    if not loops:
        return
    content = LoopsFile(loops=[_loop_row(loop) for loop in loops])
    file.write_text(content.model_dump_json(indent=1) + "\n", "utf-8")


def read_loops_file(file: Path, machine: Machine) -> tuple[Loop, ...]:
    """Return the loops of a loops.json; none if there is no such file.

    Args:
        machine: with the names of its points.

    Raises:
        InputError: the file is damaged.
    """
    if not file.is_file():
        return ()
    rows = read_result_json(file, LoopsFile, "mbw tune").loops
    names = (*machine.layout.points, *machine.layout.bodies)
    try:
        return tuple(_loop_of_row(row, names) for row in rows)
    except ValueError as error:
        raise InputError(f"{file} is damaged ({error}): tune again") from error


def known_loops(path: Path, machine: Machine) -> tuple[Loop, ...]:
    """Return the loops that were closed in the test of a machine.

    Args:
        path: a campaign.toml, or an MJCF with a loops.json beside it.
        machine: of the MJCF.

    Raises:
        InputError: a port that the machine does not have, or a damaged file.
    """
    if path.suffix == ".toml":
        return read_loops(path, machine, read_settings(path)[1].loop)
    return read_loops_file(path.parent / LOOPS_JSON, machine)


def choose_loops(loops: Sequence[Loop], patterns: Iterable[str]) -> tuple[Loop, ...]:
    """Return the loops whose names fit one of the patterns.

    Args:
        loops: that were closed during the test.
        patterns: names, perhaps with ``*`` and ``?``.

    Raises:
        UsageError: a pattern that fits no loop.
    """
    chosen: set[str] = set()
    for pattern in patterns:
        fitting = {loop.name for loop in loops if fnmatchcase(loop.name, pattern)}
        if not fitting:
            known = ", ".join(loop.name for loop in loops) or "none"
            raise UsageError(
                f"{pattern!r} is no loop that was closed during the test (there are {known}): name "
                "one, or state it as [loop.NAME] in campaign.toml"
            )
        chosen |= fitting
    return tuple(loop for loop in loops if loop.name in chosen)


def loops_sentence(loops: Sequence[Loop], closed: Sequence[Loop]) -> str:
    """Return which loops of the test are closed and which are open; empty without any.

    Args:
        loops: that were closed during the test.
        closed: those that are closed here.
    """
    names = {loop.name for loop in closed}
    groups = (
        ("closed", [loop.name for loop in loops if loop.name in names]),
        ("open", [loop.name for loop in loops if loop.name not in names]),
    )
    parts = [f"{', '.join(group)} {state}" for state, group in groups if group]
    return f"control loops of the test: {'; '.join(parts)}" if parts else ""


def _loop_row(loop: Loop) -> LoopRow:
    """Return the row of a loop."""
    controller, measured = loop.controller, loop.measured
    return LoopRow(
        name=loop.name,
        input=str(loop.input),
        input_unit=loop.input_unit,
        outputs=[str(port) for port, _ in measured.terms],
        weights=[weight for _, weight in measured.terms],
        output_unit=measured.unit,
        derivative=measured.derivative,
        delay=loop.delay,
        A=controller.dynamics.tolist(),
        B=controller.input_matrix.tolist(),
        C=controller.output_matrix.tolist(),
        D=controller.feedthrough.tolist(),
        period=controller.period_s,
        resolution=loop.resolution,
        quantisation=loop.quantisation,
        limit=loop.limit,
    )


def _loop_of_row(row: LoopRow, names: Sequence[str]) -> Loop:
    """Return the loop of a row."""
    size = len(row.A)
    controller = Controller(
        np.array(row.A).reshape(size, size),
        np.array(row.B).reshape(size, 1),
        np.array(row.C).reshape(1, size),
        np.array(row.D),
        row.period,
    )
    ports = [parse_port(text, names) for text in row.outputs]
    terms = tuple(zip(ports, row.weights, strict=True))
    return Loop(
        row.name,
        parse_port(row.input, names),
        PortSum(row.name, terms, row.output_unit, row.derivative),
        controller,
        row.input_unit,
        row.delay,
        row.resolution,
        row.quantisation,
        row.limit,
    )
