r"""One-sided power spectral densities of signals.

The mean square of a signal is the integral of its density S over positive frequencies. The density
of its nth time derivative is ``(2 pi f)^(2 n) S``: the displacement of a floor has the density of
its acceleration over ``(2 pi f)^4``.

Vibration criteria state the rms velocity v of each third-octave band, from 1 to 80 Hz (VC-A and
VC-B: a constant acceleration from 4 to 8 Hz). A density ``3 v^2 / (f ln 2)`` has exactly that rms
in each band (Amick, Gendreau, Busch, Gordon: Evolving criteria for research facilities, 2005).
"""

import re
from dataclasses import dataclass
from math import log
from pathlib import Path

import numpy as np

from identification.readers.csv_tables import read_csv_rows
from identification.readers.units import FREQUENCY_UNITS_HZ
from identification.words import InputError, Real, frozen_array
from tuning.plant.error_budget.spectral_units import (
    STANDARD_GRAVITY,
    DensityUnit,
    parse_density_unit,
)

# rms velocity of a third-octave band [m/s]; A and B hold it from 8 Hz, the others from 1 Hz.
VIBRATION_CRITERIA_M_PER_S = {
    "VC-A": 50e-6,
    "VC-B": 25e-6,
    "VC-C": 12.5e-6,
    "VC-D": 6.25e-6,
    "VC-E": 3.12e-6,
    "VC-F": 1.56e-6,
    "VC-G": 0.78e-6,
}
_ACCELERATION_BELOW_8_HZ = {"VC-A": 260e-6 * STANDARD_GRAVITY, "VC-B": 130e-6 * STANDARD_GRAVITY}
_LOWEST_CRITERION_HZ, _HIGHEST_CRITERION_HZ = 1.0, 80.0
_HALF_BAND = 2 ** (1 / 6)  # edge of a third-octave band over its centre
_CSV_REMEDY = "give a .csv table with frequencies in its first column and densities beside"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A one-sided power spectral density, zero outside its frequencies.

    Between its lines the density is a power of frequency, so that straight lines of a plot with
    two logarithmic axes are exact.

    Args:
        freq_hz: increasing [Hz]; (n,).
        density: [unit^2/Hz] in SI; (n,).
        derivative: number of time derivatives of a length or angle that the signal is; 0 for
            forces and controls.

    Raises:
        ValueError: arrays that do not fit, frequencies that do not increase, a negative density.
    """

    freq_hz: Real
    density: Real
    derivative: int = 0

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        count = np.size(self.freq_hz)
        for name in ("freq_hz", "density"):
            array = frozen_array(getattr(self, name), np.float64, (count,), name)
            object.__setattr__(self, name, array)
        if count < 2 or not (np.diff(self.freq_hz) > 0).all() or self.freq_hz[0] < 0:
            raise ValueError("frequencies must increase from 0 Hz or above, two at least")
        if not (self.density >= 0).all():
            raise ValueError("a power spectral density is negative or no number")

    @property
    def band(self) -> tuple[float, float]:
        """Lowest frequency above 0 Hz, and highest [Hz]."""
        return float(self.freq_hz[self.freq_hz > 0][0]), float(self.freq_hz[-1])

    def at(self, freq_hz: Real, derivative: int) -> Real:
        """Return the density of a time derivative of the signal [unit^2/Hz]; (n_freq,).

        Args:
            freq_hz: above 0 Hz; (n_freq,).
            derivative: number of time derivatives of the length, angle or force.
        """
        is_positive = (self.density > 0) & (self.freq_hz > 0)
        index = np.clip(np.searchsorted(self.freq_hz, freq_hz, "right"), 1, len(self.freq_hz) - 1)
        linear = np.interp(freq_hz, self.freq_hz, self.density, left=0.0, right=0.0)
        logarithms = np.log(np.where(is_positive, self.density, 1.0))
        lines = np.log(np.where(self.freq_hz > 0, self.freq_hz, 1.0))
        power = np.exp(np.interp(np.log(freq_hz), lines, logarithms))
        is_power = is_positive[index] & is_positive[index - 1] & (linear > 0)
        omega = 2 * np.pi * freq_hz
        return np.where(is_power, power, linear) * omega ** (2 * (derivative - self.derivative))


def vibration_criterion(name: str) -> Spectrum:
    """Return the velocity density of a vibration criterion, ``VC-A`` to ``VC-G``.

    Raises:
        ValueError: there is no criterion of this name.
    """
    if name not in VIBRATION_CRITERIA_M_PER_S:
        raise ValueError(f"{name!r} is no vibration criterion: write VC-A to VC-G")
    velocity, low, high = VIBRATION_CRITERIA_M_PER_S[name], _LOWEST_CRITERION_HZ, 8.0
    rows: list[tuple[float, float]] = []
    if name in _ACCELERATION_BELOW_8_HZ:
        low = 4.0 / _HALF_BAND
        rows = [(f, _ACCELERATION_BELOW_8_HZ[name] / (2 * np.pi * f)) for f in (low, high - 1e-9)]
        rows.append((high, velocity))
    else:
        rows = [(low / _HALF_BAND, velocity)]
    rows.append((_HIGHEST_CRITERION_HZ * _HALF_BAND, velocity))
    freq, rms = np.array(rows).T
    return Spectrum(freq, 3 * rms**2 / (freq * log(2)), derivative=1)


def constant_spectrum(value: float, unit: DensityUnit, band: tuple[float, float]) -> Spectrum:
    """Return a density that is constant over a band.

    Args:
        value: of the density, in ``unit``.
        unit: of the value.
        band: lowest and highest frequency [Hz].
    """
    density = _to_si(np.full(2, value), unit)
    return Spectrum(np.array(band), density, unit.signal.derivative)


def read_spectrum(
    path: Path, column: str | None, unit: str | None, *, is_two_sided: bool = False
) -> tuple[Spectrum, DensityUnit]:
    """Read a density from a .csv table; the first column holds frequencies.

    Their unit is that in brackets in the heading, such as ``w [rad/s]``; Hz without one.

    Args:
        column: heading of the column of the density, with or without its unit in brackets; None
            for the second one.
        unit: of the density; None if the heading states it in brackets.
        is_two_sided: whether the density extends to negative frequencies, so that half of the
            power lies there.

    Raises:
        InputError: a table, column, unit or number that cannot be used.
    """
    rows = [_split_cells(row) for row in read_csv_rows(path, _CSV_REMEDY)]
    rows = [row for row in rows if any(cell.strip() for cell in row) and row[0][:1] != "#"]
    heading = [cell.strip() for cell in rows[0]] if rows and not _is_number(rows[0][0]) else []
    number = _column_number(path, heading, column)
    stated = heading[number].partition("[")[2].rpartition("]")[0] if number < len(heading) else ""
    if not (unit or stated):
        raise InputError(
            f"{path}: the unit of the density is missing: state unit, such as (m/s^2)^2/Hz, or "
            "write it into the heading in brackets"
        )
    try:
        density_unit = parse_density_unit(unit or stated)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    freq, density = _read_numbers(path, rows[bool(heading) :], number)
    freq = freq * _frequency_factor(path, heading[0] if heading else "")
    values = _to_si(density, density_unit) * (2 if is_two_sided else 1)
    try:
        return Spectrum(freq, values, density_unit.signal.derivative), density_unit
    except ValueError as error:
        raise InputError(f"{path}: {error}; correct the table") from error


def _to_si(values: Real, unit: DensityUnit) -> Real:
    """Return power densities in SI of values in a unit."""
    if unit.is_root and (values < 0).any():
        return np.full(len(values), -1.0)
    power: Real = values**2 if unit.is_root else values
    return power * unit.signal.factor**2


def _frequency_factor(path: Path, heading: str) -> float:
    """Return the frequency [Hz] of one unit of the first column, by its heading."""
    stated = re.search(r"[\[(](.*)[\])]", heading)
    unit = stated[1].strip() if stated else "Hz"
    if unit not in FREQUENCY_UNITS_HZ:
        raise InputError(
            f"{path}: the heading {heading!r} states no unit of frequency that is known: write "
            f"one of {', '.join(FREQUENCY_UNITS_HZ)} in its brackets"
        )
    return FREQUENCY_UNITS_HZ[unit]


def _split_cells(row: list[str]) -> list[str]:
    """Return the cells of a row whose separators are semicolons, tabs or blanks."""
    if len(row) != 1:
        return row
    text = row[0].strip()
    for separator in (";", "\t"):
        if separator in text:
            return text.split(separator)
    return text.split() if _is_number(text.split(" ")[0]) else row


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _column_number(path: Path, heading: list[str], column: str | None) -> int:
    """Return the number of a column by its heading; the second one for None."""
    if column is None:
        return 1
    plain = [cell.partition("[")[0].strip() for cell in heading]
    for names in (heading, plain):
        if names.count(column) == 1:
            return names.index(column)
    known = ", ".join(plain[1:]) or "none: the table has no heading"
    raise InputError(f"{path} has no single column {column!r}: choose one of {known}")


def _read_numbers(path: Path, rows: list[list[str]], column: int) -> tuple[Real, Real]:
    """Return frequencies and values of a column."""
    pairs = []
    for number, row in enumerate(rows, start=1):
        try:
            pairs.append((float(row[0]), float(row[column])))
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{path}: row {number} of the numbers has no frequency and density, but "
                f"{', '.join(row)!r}: correct it"
            ) from error
    values = np.array(pairs, float).reshape(-1, 2)
    if not np.isfinite(values).all():
        raise InputError(f"{path} holds a value that is not finite: correct the table")
    return values[:, 0], values[:, 1]
