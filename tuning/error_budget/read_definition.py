"""Definition of an error budget from budget.toml, for the labels of a machine."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import Dof, Input, InputError, UsageError
from mbmodel import Machine, parse_input
from tuning.error_budget.budget_toml import (
    BudgetFile,
    CorrelationTable,
    DisturbanceTable,
    ErrorTable,
    LoopTable,
    NoiseTable,
    as_roots,
    read_budget_file,
)
from tuning.error_budget.controller import (
    Controller,
    controller_from_roots,
    controller_from_system,
    read_controller,
)
from tuning.error_budget.definition import (
    BudgetDefinition,
    Loop,
    PortSum,
    Source,
    is_motion,
)
from tuning.error_budget.source_spectra import PortKind, read_source_spectrum
from tuning.error_budget.spectral_units import SignalUnit, parse_signal_unit

_DEFAULT_BUDGET_BAND_HZ = (0.1, 1000.0)  # where no source has a band of its own
_DEFAULT_UNITS = {"length": ("nm", 1e-9), "angle": ("nrad", 1e-9)}
_MIN_COHERENCE_EIGENVALUE = -1e-9  # of the coherence matrix: rounding


def read_definition(
    path: Path, machine: Machine, controllers: Mapping[str, Any] | None = None
) -> BudgetDefinition:
    """Read the definition of an error budget.

    Args:
        path: budget.toml; files that it names lie beside it.
        machine: with the labels of inputs and outputs.
        controllers: python-control objects that replace those of the file, by the loop's name.

    Raises:
        InputError: a file, key, label or number that cannot be used.
        UsageError: a controller of a loop that the file does not have.
    """
    file = read_budget_file(path)
    unknown = set(controllers or {}) - set(file.loop)
    if unknown:
        raise UsageError(
            f"{path} has no loop {sorted(unknown)[0]!r}: add [loop.{sorted(unknown)[0]}] with its "
            "input and output"
        )
    errors = tuple(
        _signal(path, machine, f"error.{name}", name, table.output, table.minus)
        for name, table in file.error.items()
    )
    loops = tuple(
        _loop(path, machine, name, table, (controllers or {}).get(name))
        for name, table in file.loop.items()
    )
    sources = _sources(path, machine, file, loops)
    if not sources:
        raise InputError(f"{path} names no source: add [disturbance.NAME] or [noise.NAME]")
    return BudgetDefinition(
        errors,
        sources,
        loops,
        _coherence(path, sources, file.correlation),
        _band(path, file, sources),
        {signal.name: _shown_unit(path, signal, file.error[signal.name]) for signal in errors},
    )


def _signal(
    path: Path, machine: Machine, key: str, name: str, output: str, minus: str | None
) -> PortSum:
    """Return an output, or the difference of two."""
    terms = [(_output(path, machine, key, output), 1.0)]
    if minus is not None:
        terms.append((_output(path, machine, key, minus), -1.0))
    if len({dof.is_rotation for dof, _ in terms}) > 1:
        raise InputError(
            f"{path}: {key} subtracts {minus} from {output}, but one is a rotation: name two "
            "translations or two rotations"
        )
    return PortSum(name, tuple(terms))


def _output(path: Path, machine: Machine, key: str, text: str) -> Dof:
    """Return an output of the machine."""
    try:
        dof = Dof.parse(text)
        machine.layout.rows([dof])
    except (UsageError, ValueError) as error:
        raise InputError(f"{path}: {key}: {error}") from error
    return dof


def _input(path: Path, machine: Machine, key: str, text: str) -> Input:
    """Return an input of the machine."""
    try:
        port = parse_input(machine, text)
        if isinstance(port, Dof) and not is_motion(port):
            machine.layout.rows([port])
    except (UsageError, ValueError) as error:
        raise InputError(f"{path}: {key}: {error}") from error
    return port


def _loop(path: Path, machine: Machine, name: str, table: LoopTable, system: Any | None) -> Loop:
    """Return a loop; a python-control object replaces the file's controller."""
    key = f"loop.{name}"
    port = _input(path, machine, key, table.input)
    if is_motion(port):
        raise InputError(f"{path}: {key} drives the floor: name a motor or a force as input")
    measured = _signal(path, machine, key, name, table.output, table.minus)
    controller = _controller(path, key, table) if system is None else None
    return Loop(
        name,
        port,
        measured,
        controller_from_system(system) if controller is None else controller,
        table.quantity,
        table.delay,
    )


def _controller(path: Path, key: str, table: LoopTable) -> Controller:
    """Return the controller of a loop of the file."""
    roots = table.controller
    if isinstance(roots, str):
        return read_controller(path.parent / roots)
    try:
        return controller_from_roots(as_roots(roots.zeros), as_roots(roots.poles), roots.gain)
    except ValueError as error:
        raise InputError(f"{path}: {key}.controller: {error}") from error


def _sources(
    path: Path, machine: Machine, file: BudgetFile, loops: tuple[Loop, ...]
) -> tuple[Source, ...]:
    """Return disturbances and noise in the order of the file."""
    twice = set(file.disturbance) & set(file.noise)
    if twice:
        raise InputError(f"{path}: {sorted(twice)[0]!r} is a disturbance and a noise: rename one")
    band = _stated_band(path, "band", file.band)
    sources = [
        _disturbance(path, machine, name, table, band) for name, table in file.disturbance.items()
    ]
    return (
        *sources,
        *(_noise(path, name, table, loops, band) for name, table in file.noise.items()),
    )


def _disturbance(
    path: Path,
    machine: Machine,
    name: str,
    table: DisturbanceTable,
    band: tuple[float, float] | None,
) -> Source:
    """Return a disturbance with its inputs."""
    key = f"disturbance.{name}"
    texts = [table.input] if isinstance(table.input, str) else table.input
    count = len(texts)
    gains, phases = table.gain or [1.0] * count, table.phase_deg or [0.0] * count
    if not count or len(gains) != count or len(phases) != count:
        raise InputError(
            f"{path}: {key} has {count} inputs, {len(gains)} gains and {len(phases)} phases: give "
            "each input one of each"
        )
    ports = [_input(path, machine, key, text) for text in texts]
    kinds = {_port_kind(machine, port) for port in ports}
    if len(kinds) > 1:
        raise InputError(
            f"{path}: {key} acts at inputs of different units: make a disturbance of each"
        )
    factors = np.array(gains) * np.exp(1j * np.radians(phases))
    spectrum, lines = read_source_spectrum(path, key, table, kinds.pop(), band)
    inputs = tuple(zip(ports, factors.tolist(), strict=True))
    return Source(name, inputs, spectrum=spectrum, lines=lines)


def _noise(
    path: Path,
    name: str,
    table: NoiseTable,
    loops: tuple[Loop, ...],
    band: tuple[float, float] | None,
) -> Source:
    """Return the noise of a loop's measurement."""
    key = f"noise.{name}"
    loop = next((loop for loop in loops if loop.name == table.loop), None)
    if loop is None:
        known = ", ".join(loop.name for loop in loops) or "none"
        raise InputError(
            f"{path}: {key} disturbs the loop {table.loop!r}, which the file lacks: choose one of "
            f"{known}"
        )
    kind = PortKind("angle" if loop.measured.is_rotation else "length", loop.derivative)
    spectrum, lines = read_source_spectrum(path, key, table, kind, band)
    return Source(name, noise_of=loop.name, spectrum=spectrum, lines=lines)


def _port_kind(machine: Machine, port: Input) -> PortKind:
    """Return what an input is: a motion, a force, a torque or a control."""
    del machine
    if not isinstance(port, Dof):
        return PortKind("control", 0)
    if is_motion(port):
        return PortKind("angle" if port.is_rotation else "length", 2)
    return PortKind("torque" if port.is_rotation else "force", 0)


def _coherence(
    path: Path, sources: tuple[Source, ...], rows: Iterable[CorrelationTable]
) -> np.ndarray[tuple[int, int], np.dtype]:
    """Return the complex coherence of the sources."""
    names = [source.name for source in sources]
    matrix = np.eye(len(names), dtype=complex)
    for row in rows:
        for name in row.between:
            if name not in names:
                raise InputError(f"{path}: a correlation names {name!r}, which is no source")
        first, second = (names.index(name) for name in row.between)
        if first == second:
            raise InputError(f"{path}: a correlation of {row.between[0]!r} with itself: remove it")
        value = np.sqrt(row.coherence) * np.exp(1j * np.radians(row.phase_deg))
        matrix[first, second], matrix[second, first] = value, value.conjugate()
    if np.linalg.eigvalsh(matrix).min() < _MIN_COHERENCE_EIGENVALUE:
        raise InputError(
            f"{path}: no signals have these coherences together: two that are nearly the same "
            "signal are equally coherent with a third; lower one"
        )
    return matrix


def _stated_band(path: Path, key: str, band: list[float] | None) -> tuple[float, float] | None:
    """Return a band of the file after checking it."""
    if band is None:
        return None
    low, high = band
    if not 0 < low < high:
        raise InputError(f"{path}: {key} = {band}: give two frequencies above 0 Hz, lower first")
    return low, high


def _band(path: Path, file: BudgetFile, sources: tuple[Source, ...]) -> tuple[float, float]:
    """Return the stated band, or that of all spectra."""
    stated = _stated_band(path, "band", file.band)
    if stated is not None:
        return stated
    bands = [source.spectrum.band for source in sources if source.spectrum is not None]
    if not bands:
        return _DEFAULT_BUDGET_BAND_HZ
    lows, highs = zip(*bands, strict=True)
    return min(lows), max(highs)


def _shown_unit(path: Path, signal: PortSum, table: ErrorTable) -> tuple[str, float]:
    """Return the unit in which an error is shown, with its SI value."""
    kind = "angle" if signal.is_rotation else "length"
    if table.unit is None:
        return _DEFAULT_UNITS[kind]
    try:
        unit = parse_signal_unit(table.unit)
    except ValueError:
        unit = SignalUnit("control", 0, 1.0)
    if unit.kind != kind or unit.derivative:
        example = "nrad" if signal.is_rotation else "nm"
        raise InputError(
            f"{path}: error.{signal.name}.unit = {table.unit!r} is no unit of this error: write "
            f"for example {example}"
        )
    return table.unit, unit.factor
