"""Definition of an error budget from budget.toml, for the labels of a machine."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import (
    JOINT_PREFIX,
    Input,
    InputError,
    Loop,
    PortSum,
    UsageError,
    sampling_period,
)
from mbmodel import CONTROL, Machine, input_unit
from tuning.control_loops.read_loops import read_input, read_loops, read_port_sum
from tuning.plant.error_budget.budget_toml import (
    BudgetFile,
    CorrelationTable,
    DisturbanceTable,
    ErrorTable,
    NoiseTable,
    read_budget_file,
)
from tuning.plant.error_budget.definition import BudgetDefinition, Source
from tuning.plant.error_budget.source_spectra import PortKind, read_source_spectrum, stated_kind
from tuning.plant.error_budget.spectral_units import Kind, fits, parse_signal_unit

DEFAULT_BUDGET_BAND_HZ = (0.1, 1000.0)  # where no source has a band of its own
_DEFAULT_UNITS = {"m": ("nm", 1e-9), "rad": ("nrad", 1e-9)}  # shown, with their SI value
_COVERED = 1.05  # ratio of frequencies that counts as the same end of a band
_MIN_COHERENCE_EIGENVALUE = -1e-9  # of the coherence matrix: rounding
FORCE_UNITS: dict[Kind | None, str] = {"force": "N", "torque": "N m"}


def read_definition(
    path: Path,
    machine: Machine,
    controllers: Mapping[str, Any] | None = None,
    *,
    loops_suffice: bool = False,
) -> BudgetDefinition:
    """Read the definition of an error budget.

    Args:
        path: budget.toml; files that it names lie beside it.
        machine: with the labels of inputs and outputs. Loops that are closed around it count
            beside those of the file.
        controllers: python-control objects that replace those of the file, by the loop's name.
        loops_suffice: whether the file may name loops alone, as margins and simulations need.

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
        read_port_sum(path, machine, f"error.{name}", (table.output, table.minus))
        for name, table in file.error.items()
    )
    twice = [loop.name for loop in machine.loops if loop.name in file.loop]
    if twice:
        raise InputError(
            f"{path}: loop.{twice[0]} has the name of a loop that was closed during the test and "
            "is closed here, so that it would count twice: open that one, or rename this one"
        )
    loops = (*machine.loops, *read_loops(path, machine, file.loop, controllers))
    sampling_period(loops)  # refuses loops of different periods
    sources = _sources(path, machine, file, loops)
    if not errors and not loops_suffice:
        raise InputError(f"{path} names no error: add [error.NAME] with its output")
    if not sources and not loops_suffice:
        raise InputError(f"{path} names no source: add [disturbance.NAME] or [noise.NAME]")
    band = _band(path, file, sources)
    return BudgetDefinition(
        errors,
        sources,
        loops,
        _coherence(path, sources, file.correlation),
        band,
        {signal.name: _shown_unit(path, signal, file.error[signal.name]) for signal in errors},
        (*_uncovered_bands(sources, band), *_nonlinear_loops(loops)),
    )


def _nonlinear_loops(loops: tuple[Loop, ...]) -> Iterator[str]:
    """Yield a sentence on loops whose limit, quantisation or resolution act in time alone."""
    names = [loop.name for loop in loops if not loop.is_linear]
    if names:
        yield (
            f"A budget is linear: limit, quantisation and resolution of {', '.join(names)} act in "
            "mbw simulate --budget alone."
        )


def _uncovered_bands(sources: tuple[Source, ...], band: tuple[float, float]) -> Iterator[str]:
    """Yield a sentence on each spectrum that does not cover the band."""
    for source in sources:
        if source.spectrum is None:
            continue
        low, high = source.spectrum.band
        if low > band[0] * _COVERED or high * _COVERED < band[1]:
            yield (
                f"The spectrum of {source.name} covers {low:.4g} to {high:.4g} Hz of the band from "
                f"{band[0]:.4g} to {band[1]:.4g} Hz: elsewhere it counts as zero."
            )


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
    ports = [read_input(path, machine, key, text) for text in texts]
    kinds = {PortKind(input_unit(machine, port)) for port in ports}
    if len(kinds) > 1:
        raise InputError(
            f"{path}: {key} acts at inputs of different units: make a disturbance of each"
        )
    factors = np.array(gains) * np.exp(1j * np.radians(phases))
    kind, stated = kinds.pop(), stated_kind(path, table)
    if kind.unit == CONTROL and stated in FORCE_UNITS:
        kind = PortKind(FORCE_UNITS[stated])
        factors /= [motor_force(path, key, machine, port, kind.unit) for port in ports]
    spectrum, lines = read_source_spectrum(path, key, table, kind, band)
    inputs = tuple(zip(ports, factors.tolist(), strict=True))
    return Source(name, inputs, "", spectrum, lines, kind.unit, kind.derivative)


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
    kind = PortKind(loop.measured.unit)
    spectrum, lines = read_source_spectrum(path, key, table, kind, band)
    return Source(name, (), loop.name, spectrum, lines, kind.unit, kind.derivative)


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
    if np.linalg.eigvalsh(matrix).min(initial=0.0) < _MIN_COHERENCE_EIGENVALUE:
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
        return DEFAULT_BUDGET_BAND_HZ
    lows, highs = zip(*bands, strict=True)
    return min(lows), max(highs)


def _shown_unit(path: Path, signal: PortSum, table: ErrorTable) -> tuple[str, float]:
    """Return the unit in which an error is shown, with its SI value."""
    default = _DEFAULT_UNITS.get(signal.unit, (signal.unit, 1.0))
    if table.unit is None:
        return default
    kind = PortKind(signal.unit)
    try:
        unit = parse_signal_unit(table.unit)
    except ValueError:
        unit = None
    is_known = unit is not None and fits(unit.kind, kind.kind)
    if unit is None or not is_known or unit.derivative != kind.derivative:
        raise InputError(
            f"{path}: error.{signal.name}.unit = {table.unit!r} is no unit of this error, which is "
            f"in {signal.unit}: write for example {default[0]}"
        )
    return table.unit, unit.factor


def motor_force(path: Path, key: str, machine: Machine, port: Input, unit: str) -> float:
    """Return the force or torque of a motor at its slide or hinge per unit of its control.

    Args:
        path: budget.toml, for messages.
        key: of the disturbance, for messages.
        machine: with the motor.
        port: the motor.
        unit: N or N m.

    Raises:
        InputError: a motor at no single slide or hinge, or a unit of the other kind.
    """
    gain = machine.motors[str(port)]
    driven = machine.driven_axle(str(port))
    along = 0.0 if driven is None else driven[1] * driven[0].motion(len(gain.joint))
    if driven is None or gain.body.any() or not np.allclose(gain.joint, along, rtol=1e-9, atol=0):
        raise InputError(
            f"{path}: {key} is stated in {unit}, but {port} acts at no single slide or hinge: "
            "state it in units of its control, such as 1/sqrt(Hz)"
        )
    if gain.activation is not None:
        raise InputError(
            f"{path}: {key} is stated in {unit}, but {port} follows its control late: name the "
            f"force {JOINT_PREFIX}{driven[0].joint}, or state it in units of its control"
        )
    axle, force = driven
    needed = "N m" if axle.turns else "N"
    if unit != needed:
        raise InputError(
            f"{path}: {key} is stated in {unit}, but {port} acts at {axle.joint} in {needed}: "
            f"write {needed}/sqrt(Hz), or 1/sqrt(Hz) for units of its control"
        )
    return force
