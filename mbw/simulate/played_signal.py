"""Signals that ``mbw simulate`` plays: from a CSV, or step, move, chirp, noise; their responses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io
from scipy.interpolate import CubicSpline

from identification.readers.csv_tables import read_number_table
from identification.readers.result_files import write_result_arrays
from identification.words import (
    InputError,
    Quantity,
    Real,
    UsageError,
    read_number,
    sampling_period,
)
from identification.words.csv_cells import write_csv
from mbmodel import Machine, with_loops
from mbmodel.export.linear_response import even_step
from mbmodel.simulation.signals import (
    chirp_signal,
    flat_density,
    move_signal,
    noise_signal,
    step_signal,
    time_axis,
)
from mbw.messages import SCREEN
from tuning.control_loops.loops_file import choose_loops, known_loops, loops_sentence
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_plant import loops_alone
from tuning.plant.error_budget.read_definition import DEFAULT_BUDGET_BAND_HZ, read_definition
from tuning.plant.error_budget.simulated_budget import instability_remark, sampled_rate

KINDS = ("step", "move", "chirp", "noise", "psd")
_SIGNAL_BAND_HZ = (5.0, 200.0)
_SIGNAL_RATE_HZ = 2048.0
_SIGNAL_AMPLITUDE, _SIGNAL_DURATION_S = 1.0, 2.0
_BUDGET_DURATION_S = 10.0  # of random sources alone, whose rms is sought
_MOVE_ORDERS = (3, 4)
_SAME_RATE = 1e-9  # relative
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
        limits: text of the largest derivatives of a move; None for none.
        budget: budget.toml whose loops, sources and errors are simulated; None for none.
        closed: names or patterns of loops of the test that are closed.
        window: tracking error within which a move has settled; None for 2 % of it.
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
    limits: str | None
    budget: Path | None
    closed: Sequence[str]
    window: float | None
    outputs: Sequence[str]
    quantity: str
    animate: Path | None

    @property
    def is_asked(self) -> bool:
        """Whether a signal is played, or loops are closed."""
        values = (self.signals, self.kind, self.psd, self.at, self.budget)
        return bool(self.closed) or any(value is not None for value in values)


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


def load_signal(options: PlayOptions, seed: int, definition: BudgetDefinition) -> PlayedSignal:
    """Return the signal that the options name, at a rate that suits loops and sources.

    Args:
        seed: of noise.
        definition: loops and sources that act beside it.

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
        return _resample(PlayedSignal(labels, table[:, 0], table[:, 1:]), definition)
    is_silent = options.kind is None and options.psd is None and options.at is None
    if is_silent and definition.sources:
        duration_s = _BUDGET_DURATION_S if options.duration_s is None else options.duration_s
        time_s = time_axis(duration_s, _rate(options, definition))
        return PlayedSignal((), time_s, np.zeros((len(time_s), 0)))
    if is_silent:
        raise UsageError(
            "the loops are closed and nothing moves: add --signal move --at reference:<loop> with "
            "--limits, another signal, or a budget with sources"
        )
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
    rate = _rate(options, definition)
    duration_s = _SIGNAL_DURATION_S if options.duration_s is None else options.duration_s
    time_s = time_axis(duration_s, rate)
    values = _make_signal(options, kind, amplitude, time_s, seed)
    return PlayedSignal((options.at,), time_s, values[:, None])


def _rate(options: PlayOptions, definition: BudgetDefinition) -> float:
    """Return the rate of a made signal [Hz]: as stated, or what loops and sources need."""
    if options.rate_hz is None:
        return sampled_rate(definition, _SIGNAL_RATE_HZ)
    if options.rate_hz <= 0:
        raise UsageError(f"--rate {options.rate_hz:g}: give a number above 0, or leave it out")
    return options.rate_hz


def _resample(signal: PlayedSignal, definition: BudgetDefinition) -> PlayedSignal:
    """Return a signal at a rate of which the sampling of loops is a part, by a cubic spline."""
    step, start = even_step(signal.time_s), signal.time_s[0]
    rate = sampled_rate(definition, 1 / step)
    if not definition.loops or abs(rate * step - 1) < _SAME_RATE:
        return signal
    count = int((signal.time_s[-1] - start) * rate + _SAME_RATE) + 1
    time_s = start + np.arange(count) / rate
    return PlayedSignal(signal.labels, time_s, CubicSpline(signal.time_s, signal.values)(time_s))


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
    if kind == "move":
        return move_signal(time_s, amplitude, _parse_limits(options.limits))
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


def _parse_limits(text: str | None) -> list[float]:
    """Return the largest derivatives of a move."""
    values = [read_number(part) for part in (text or "").split(",")]
    if len(values) not in _MOVE_ORDERS or any(map(math.isnan, values)):
        raise UsageError(
            f"--limits {text or ''!r}: write the largest velocity, acceleration and jerk of the "
            "move, and perhaps its snap, such as 0.1,1,50,1e4"
        )
    return values


def _read_table(path: Path) -> tuple[tuple[str, ...], Real]:
    """Return the labels of a CSV's columns from the second on, and its numbers; (n, n_column)."""
    header, table = read_number_table(path, "give a CSV with a header and columns of numbers")
    if len(table) < 2 or len(header) < 2:
        raise InputError(f"{path}: give a header, then rows of at least two columns")
    return tuple(header[1:]), table


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


def find_definition(machine: Machine, loops_source: Path, options: PlayOptions) -> BudgetDefinition:
    """Return the loops that are closed in time, and sources and errors of the budget, if any.

    Args:
        machine: as simulated.
        loops_source: campaign.toml, or the MJCF beside which the loops of the test stand.
        options: budget, and loops of the test that are closed.

    Raises:
        UsageError: a name that fits no loop.
        InputError: a file that cannot be used.
    """
    tested = known_loops(loops_source, machine)
    closed = choose_loops(tested, options.closed)
    if sentence := loops_sentence(tested, closed):
        SCREEN.say(sentence)
    definition = loops_alone(closed, DEFAULT_BUDGET_BAND_HZ)
    if options.budget is not None:
        definition = read_definition(
            options.budget, with_loops(machine, closed), loops_suffice=True
        )
    sampling_period(definition.loops)  # refuses loops of different periods
    remark = instability_remark(machine, definition)
    for sentence in (*definition.remarks, *([remark] if remark else [])):
        SCREEN.say(sentence)
    return definition
