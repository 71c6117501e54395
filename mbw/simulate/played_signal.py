"""Signals that ``mbw simulate`` plays: from a CSV, or step, chirp and noise; files of responses."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io

from identification.readers.result_files import write_result_arrays
from identification.words import DERIVATIVE_ORDER, InputError, Quantity, Real, UsageError
from identification.words.csv_cells import write_csv
from identification.words.file_access import check_file
from mbmodel.export.linear_response import even_step
from mbmodel.simulation.signals import (
    chirp_signal,
    flat_density,
    noise_signal,
    step_signal,
    time_axis,
)

KINDS = ("step", "chirp", "noise", "psd")
_SIGNAL_BAND_HZ = (5.0, 200.0)
_SIGNAL_RATE_HZ = 2048.0
_SIGNAL_AMPLITUDE, _SIGNAL_DURATION_S = 1.0, 2.0
DEFAULT_QUANTITY: Quantity = "accelerance"


@dataclass(frozen=True)
class PlayOptions:
    """Values of the options of a played signal.

    Args:
        signals: CSV of time and inputs; None for a signal that is made.
        kind: of the signal that is made: step, chirp, noise, psd; None for none.
        at: label of its input.
        amplitude: height, or rms of noise; None for 1.
        duration_s: length [s]; None for 2.
        rate_hz: samples per second; None for 2048.
        band: of chirp and noise [Hz]; None for 5 to 200 Hz.
        psd: table of frequency and power density; None for none.
        outputs: labels; empty for all accelerometers.
        quantity: of the outputs.
        animate: picture or video of the motion; None for none.
    """

    signals: Path | None
    kind: str | None
    at: str | None
    amplitude: float | None
    duration_s: float | None
    rate_hz: float | None
    band: tuple[float, float] | None
    psd: Path | None
    outputs: Sequence[str]
    quantity: str
    animate: Path | None

    @property
    def is_asked(self) -> bool:
        """Whether a signal is played at all."""
        return any(value is not None for value in (self.signals, self.kind, self.psd, self.at))


@dataclass(frozen=True, eq=False)
class PlayedSignal:
    """Inputs of a simulation.

    Args:
        labels: of the inputs.
        time_s: instants [s]; (n_time,).
        values: of the inputs; (n_time, n_in).
    """

    labels: tuple[str, ...]
    time_s: Real
    values: Real


def parse_quantity(text: str) -> Quantity:
    """Return a quantity.

    Raises:
        UsageError: the text is none.
    """
    if text not in DERIVATIVE_ORDER:
        raise UsageError(f"{text!r} is no quantity: write one of {', '.join(DERIVATIVE_ORDER)}")
    return text


def load_signal(options: PlayOptions, seed: int) -> PlayedSignal:
    """Return the signal that the options name.

    Args:
        seed: of noise.

    Raises:
        UsageError: options contradict one another.
        InputError: a table cannot be read.
    """
    if options.signals is not None:
        labels, table = _read_table(options.signals)
        try:
            even_step(table[:, 0])
        except UsageError as error:
            raise InputError(f"{options.signals}: {error}") from error
        return PlayedSignal(labels, table[:, 0], table[:, 1:])
    if options.kind is None and options.psd is None:
        raise UsageError("--at is the place of a signal: add --signal step, chirp, noise or psd")
    kind = options.kind or "psd"
    if kind not in KINDS:
        raise UsageError(f"--signal {kind!r}: write one of {', '.join(KINDS)}")
    if options.at is None:
        raise UsageError("--signal needs the place where it acts: add --at, such as hit11:+tx")
    amplitude = _SIGNAL_AMPLITUDE if options.amplitude is None else options.amplitude
    if not np.isfinite(amplitude):
        raise UsageError(f"--amplitude {amplitude}: give a number")
    rate = _SIGNAL_RATE_HZ if options.rate_hz is None else options.rate_hz
    if rate <= 0:
        raise UsageError(f"--rate {rate:g}: give a number above 0, or leave it out")
    duration_s = _SIGNAL_DURATION_S if options.duration_s is None else options.duration_s
    time_s = time_axis(duration_s, rate)
    values = _make_signal(options, kind, amplitude, time_s, seed)
    return PlayedSignal((options.at,), time_s, values[:, None])


def _make_signal(
    options: PlayOptions, kind: str, amplitude: float, time_s: Real, seed: int
) -> Real:
    """Return step, chirp or noise; (n_time,)."""
    low, high = band = options.band or _SIGNAL_BAND_HZ
    nyquist = 0.5 / (time_s[1] - time_s[0])
    if not 0 <= low < high <= nyquist:
        raise UsageError(
            f"--band {low:g} {high:g}: give LOW below HIGH, at most half the rate, {nyquist:g} Hz"
        )
    if kind == "step":
        return step_signal(time_s, amplitude)
    if kind == "chirp":
        return chirp_signal(time_s, amplitude, band)
    if (kind == "psd") != (options.psd is not None):
        raise UsageError("--signal psd and --psd FILE belong together: give both, or noise")
    if options.psd is None:
        freq_hz, density = flat_density(amplitude, band)
    else:
        _, table = _read_table(options.psd)
        freq_hz, density = table[:, 0], table[:, 1]
        if not ((np.diff(freq_hz) > 0).all() and (density >= 0).all()):
            raise InputError(
                f"{options.psd}: frequencies must rise and densities be 0 or more: correct them"
            )
    return noise_signal(time_s, freq_hz, density, np.random.default_rng(seed))


def _read_table(path: Path) -> tuple[tuple[str, ...], Real]:
    """Return the labels of a CSV's columns from the second on, and its numbers; (n, n_column)."""
    check_file(path, "a CSV with a header and columns of numbers is needed")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read ({error}): save it as CSV") from error
    if len(rows) < 3 or len(rows[0]) < 2:
        raise InputError(f"{path}: give a header, then rows of at least two columns")
    width = len(rows[0])
    numbers = []
    for line, row in enumerate(rows[1:], start=2):
        try:
            numbers.append([float(cell) for cell in row])
        except ValueError as error:
            raise InputError(f"{path}, row {line}: {error}: write numbers") from error
        if len(row) != width:
            raise InputError(f"{path}, row {line} has {len(row)} columns, the header {width}")
    table = np.array(numbers)
    if not np.isfinite(table).all():
        raise InputError(f"{path} holds NaN or infinite numbers: correct them")
    return tuple(cell.strip() for cell in rows[0][1:]), table


def write_response(target: Path, time_s: Real, columns: Sequence[tuple[str, str, Real]]) -> None:
    """Write a response as CSV, .npz or .mat.

    Args:
        time_s: instants [s]; (n_time,).
        columns: label, unit and values of inputs and outputs; (n_time,) each.
    """
    values = np.column_stack([time_s, *(column for _, _, column in columns)])
    labels = [f"{label} [{unit}]".replace("²", "^2") for label, unit, _ in columns]
    if target.suffix == ".csv":
        with target.open("w", newline="", encoding="utf-8") as file:
            write_csv(file, [["time [s]", *labels]])
            write_csv(file, ([f"{value:.12g}" for value in row] for row in values))
        return
    arrays = {"time_s": time_s, "values": values[:, 1:]}
    if target.suffix == ".mat":
        columns_of_mat = {"time_s": time_s[:, None], "labels": np.array(labels, object)}
        scipy.io.savemat(target, {**arrays, **columns_of_mat})
    else:
        write_result_arrays(target, {"labels": np.array(labels), **arrays})
