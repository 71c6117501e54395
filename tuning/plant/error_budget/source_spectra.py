r"""Spectrum of one source of budget.toml, with the units of its input.

Power of an error at the images of sampled loops, beside its budget.

A signal of frequency f makes the held controls of sampled loops move the machine at f + k / T too.
With U the controls per source before their hold, the error has there

    E_k = G_zu(s_k) h(s_k) exp(-s_k tau) U(s),   s_k = s + 2 pi i k / T
    U = -K (1 + G_d K)^-1 (G_yd d + n)

and the mean square over time is the sum over all k. The budget holds k = 0.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.words import InputError, Real, percent_text, sampling_period
from mbmodel import CONTROL, Evaluator, FrfRequest
from tuning.plant.error_budget.budget import ErrorBudget
from tuning.plant.error_budget.budget_toml import LineTable, SpectrumTable
from tuning.plant.error_budget.closed_loop_states import LoopAliases, held_law
from tuning.plant.error_budget.definition import HarmonicLines
from tuning.plant.error_budget.loop_algebra import loop_gains, measured_rows
from tuning.plant.error_budget.spectra import (
    Spectrum,
    constant_spectrum,
    read_spectrum,
    vibration_criterion,
)
from tuning.plant.error_budget.spectral_units import (
    Kind,
    SignalUnit,
    fits,
    parse_density_unit,
    parse_signal_unit,
)

_SOURCE_KINDS = "csv, vc, density or lines"


@dataclass(frozen=True)
class PortKind:
    """What a source drives.

    Args:
        unit: its SI unit; ``control`` for a motor.
    """

    unit: str

    @property
    def signal(self) -> SignalUnit:
        """Unit as kind and number of time derivatives."""
        try:
            return parse_signal_unit(self.unit)
        except ValueError:
            return SignalUnit("control", 0, 1.0)

    @property
    def kind(self) -> Kind:
        """Kind of the signal."""
        return self.signal.kind

    @property
    def derivative(self) -> int:
        """Number of time derivatives of a length or angle."""
        return self.signal.derivative


def stated_kind(path: Path, table: SpectrumTable) -> Kind | None:
    """Return the kind of signal whose unit a source states; None without a unit that is known.

    Raises:
        InputError: a table that cannot be read.
    """
    if table.csv is not None:
        return read_spectrum(path.parent / table.csv, table.column, table.unit)[1].signal.kind
    for parse in (lambda text: parse_density_unit(text).signal, parse_signal_unit):
        try:
            return parse(table.unit or "").kind
        except ValueError:
            continue
    return None


def read_source_spectrum(
    path: Path,
    key: str,
    table: SpectrumTable,
    port: PortKind,
    band: tuple[float, float] | None,
) -> tuple[Spectrum | None, HarmonicLines | None]:
    """Return density and lines of a source, in SI.

    Args:
        path: budget.toml, for messages; tables lie beside it.
        key: of the source, for messages.
        table: its settings.
        port: what it drives.
        band: of the budget, in which a constant density holds; None if not stated.

    Raises:
        InputError: no spectrum or more than one, a unit of another signal, or a missing number.
    """
    given = [name for name in ("csv", "vc", "density") if getattr(table, name) is not None]
    if len(given) > 1 or not (given or table.lines):
        what = " and ".join(given) or "no spectrum"
        raise InputError(f"{path}: {key} has {what}: give one of {_SOURCE_KINDS}")
    spectrum = _spectrum(path, key, table, port, band) if given else None
    lines = _lines(path, key, table, port) if table.lines else None
    return spectrum, lines


def _spectrum(
    path: Path,
    key: str,
    table: SpectrumTable,
    port: PortKind,
    band: tuple[float, float] | None,
) -> Spectrum:
    """Return the density of a source."""
    if table.csv is not None:
        spectrum, unit = read_spectrum(
            path.parent / table.csv, table.column, table.unit, is_two_sided=table.two_sided
        )
        _check_kind(path, key, table.unit or "the unit of the table", unit.signal, port)
        return spectrum
    if table.vc is not None:
        if port.kind != "length":
            raise InputError(
                f"{path}: {key}: a vibration criterion is a velocity along an axis, but the input "
                f"takes {port.unit}: name a translation of the floor"
            )
        try:
            return vibration_criterion(table.vc)
        except ValueError as error:
            raise InputError(f"{path}: {key}: {error}") from error
    limits = tuple(table.band) if table.band is not None else band
    if limits is None or not 0 < limits[0] < limits[1]:
        raise InputError(
            f"{path}: {key} has a constant density without limits: state band = [LOW, HIGH] in Hz, "
            "there or for the whole budget"
        )
    if table.unit is None or table.density is None:
        example = "1" if port.unit == CONTROL else port.unit
        raise InputError(f"{path}: {key}.unit is missing: state it, such as {example}/sqrt(Hz)")
    try:
        unit = parse_density_unit(table.unit)
    except ValueError as error:
        raise InputError(f"{path}: {key}: {error}") from error
    _check_kind(path, key, table.unit, unit.signal, port)
    spectrum = constant_spectrum(table.density, unit, (limits[0], limits[1]))
    factor = 2.0 if table.two_sided else 1.0
    return Spectrum(spectrum.freq_hz, factor * spectrum.density, spectrum.derivative)


def _check_kind(path: Path, key: str, text: str, unit: SignalUnit, port: PortKind) -> None:
    """Refuse a unit of another signal than the input takes."""
    if port.unit == CONTROL and unit.kind != "control":
        raise InputError(
            f"{path}: {key}: {text} is not known of this input, since a motor takes units of its "
            "control, which the model does not state: write 1/sqrt(Hz) for them, or N/sqrt(Hz) or "
            "N m/sqrt(Hz) for the force or torque at its joint"
        )
    if not fits(unit.kind, port.kind):
        raise InputError(
            f"{path}: {key}: {text} is no unit of an input that takes {port.unit}: correct it"
        )


def _lines(path: Path, key: str, table: SpectrumTable, port: PortKind) -> HarmonicLines:
    """Return the sines of a source."""
    speed = table.speed_hz
    if table.speed_rpm is not None:
        if speed is not None:
            raise InputError(f"{path}: {key} states speed_hz and speed_rpm: give one")
        speed = table.speed_rpm / 60
    factor, derivative = _amplitude_unit(path, key, table, port)
    rows = [
        _line(path, f"{key}.lines.{k}", row, speed, port) for k, row in enumerate(table.lines, 1)
    ]
    freq, amplitude, is_force = (np.array(column) for column in zip(*rows, strict=True))
    scale = np.where(is_force, 1.0, factor * (2 * np.pi * freq) ** (port.derivative - derivative))
    return HarmonicLines(freq, amplitude * scale)


def _amplitude_unit(
    path: Path, key: str, table: SpectrumTable, port: PortKind
) -> tuple[float, int]:
    """Return SI value and number of derivatives of the unit of amplitudes."""
    given = table.unit if table.csv is None and table.density is None else None
    if given is None:
        return 1.0, port.derivative
    try:
        unit = parse_signal_unit(given)
    except ValueError as error:
        raise InputError(f"{path}: {key}: {error}") from error
    _check_kind(path, key, given, unit, port)
    return unit.factor, unit.derivative


def _line(
    path: Path, key: str, row: LineTable, speed: float | None, port: PortKind
) -> tuple[float, float, bool]:
    """Return frequency [Hz] and peak of a sine, and whether the peak is a force already."""
    if (row.order is None) == (row.frequency is None):
        raise InputError(f"{path}: {key}: give its order or its frequency")
    if (row.amplitude is None) == (row.unbalance is None):
        raise InputError(f"{path}: {key}: give its amplitude or its unbalance")
    if row.order is not None and speed is None:
        raise InputError(f"{path}: {key} is a multiple of a speed: state speed_hz or speed_rpm")
    frequency = float(row.frequency or (row.order or 0.0) * (speed or 0.0))
    if row.unbalance is not None:
        if port.kind != "force":
            raise InputError(
                f"{path}: {key}: an unbalance is a force, but the input takes {port.unit}"
            )
        return frequency, row.unbalance * (2 * np.pi * frequency) ** 2, True
    return frequency, row.amplitude or 0.0, False


# Images on either side that are counted: each further one falls with the plant and the hold.
_IMAGES = (-3, -2, -1, 1, 2, 3)
_MIN_SHARE_OF_RATE = 1e-9  # of the sampling rate: an image that falls on 0 Hz is taken here
_MIN_STATED_SHARE = 0.01  # of the mean square, whose root changes by half of it


def image_shares(budget: ErrorBudget) -> Real:
    """Return the mean square of each error at the images, over that of its budget; (n_error,).

    Args:
        budget: with or without sampled loops.
    """
    definition, ports, lines = budget.definition, budget.ports, budget.linearised
    period = sampling_period(definition.loops)
    if not period:
        return np.zeros(len(definition.errors))
    laplace, frfs = lines.request.laplace, lines.values
    images = LoopAliases.of(lines.model, lines.theta, definition, ports).at(laplace)
    returned = np.eye(len(definition.loops)) + loop_gains(definition, ports, frfs, laplace, images)
    read = measured_rows(definition, ports, laplace) @ (frfs @ ports.disturbances) + ports.noise
    gains = np.stack([loop.controller.sampled_response(laplace) for loop in definition.loops], -1)
    # (1 + G K)^-1 stands before K: u = -K y, y = (1 + G K)^-1 (...)
    controls = -gains[:, :, None] * np.linalg.solve(returned, read)
    power = np.zeros(len(definition.errors))
    for image in _IMAGES:
        freq = budget.freq_hz + image / period
        size = np.maximum(np.abs(freq), _MIN_SHARE_OF_RATE / period)
        request = FrfRequest(size, ports.outputs, ports.inputs, "receptance")
        values = Evaluator(lines.model, request).at(lines.theta).values
        values = np.where((freq < 0)[:, None, None], values.conj(), values)
        shifted = laplace + 2j * np.pi * image / period
        held = np.stack([held_law(loop, shifted) for loop in definition.loops], -1)
        moved = ports.errors @ values @ (ports.controls * held[:, None, :]) @ controls
        scaled = moved * budget.weights[:, None, :]
        power += ((scaled @ definition.coherence) * scaled.conj()).real.sum(axis=(0, 2))
    total = budget.rms**2
    return np.divide(power, total, out=np.zeros_like(power), where=total > 0)


def image_sentences(budget: ErrorBudget) -> list[str]:
    """Return a sentence on each error to which the images of sampled loops add 1 % or more."""
    errors = budget.definition.errors
    return [
        f"Sampling moves {error.name} at other frequencies too: images of the sampling rate add "
        f"{percent_text(share, 3)} to its mean square, which the rms leaves out."
        for error, share in zip(errors, image_shares(budget), strict=True)
        if share >= _MIN_STATED_SHARE
    ]
