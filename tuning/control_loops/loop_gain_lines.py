"""Frequency lines at which a loop gain is known closely enough for its margins.

A curve L(i w) is followed until neighbouring lines lie close together as seen from the critical
point -1, and in phase. Crossings are then found by the Illinois algorithm (Dowell and Jarratt 1971,
BIT 11, 168-174) and peaks by finer lines around the largest value.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Integers, Real

LoopGainOf = Callable[[Real], Complex]
"""Returns the loop gains GK (n_freq, n_loop, n_loop) at lines [Hz] (n_freq,)."""


@dataclass(frozen=True)
class LineSettings:
    """Constants of the search for lines.

    Args:
        lines_per_decade: at the beginning; everything finer is found by halving.
        max_step: of L between lines, in units of its distance from -1: |S| changes as much.
        max_turn_rad: of L between lines, so that no crossing of the real axis is jumped over.
        min_size: of L below which its turns do not matter: gain margins beyond 60 dB.
        halvings: of a step at most.
        crossing_rounds: of the Illinois algorithm at most.
        crossing_tolerance: of log |L| and of the angle of -L [rad].
        peak_rounds: each takes a quarter of the interval around the peak.
        peak_lines: in each such interval.
    """

    lines_per_decade: int = 60
    max_step: float = 0.25
    max_turn_rad: float = 0.25
    min_size: float = 1e-3
    halvings: int = 14
    crossing_rounds: int = 12
    crossing_tolerance: float = 1e-11
    peak_rounds: int = 4
    peak_lines: int = 9


LINE_SETTINGS = LineSettings()
# Distances of lines from a pole in half widths of its resonance.
_NEAR_POLES = np.tan(np.linspace(-1.5, 1.5, 21))
_MIN_POLE_DAMPING = 1e-6  # of a pole with lines of its own


def sensitivity(gains: Complex) -> Complex:
    """Return S = (1 + GK)^-1; (n_freq, n_loop, n_loop)."""
    return np.asarray(np.linalg.inv(np.eye(gains.shape[-1]) + gains))


def single_loop_gains(gains: Complex) -> Complex:
    """Return the gain of each loop with all others closed, 1 / S_ll - 1; (n_freq, n_loop).

    It is the Schur complement of the return difference 1 + GK.
    """
    if gains.shape[-1] == 1:
        return gains[:, :, 0]
    return np.asarray(1.0 / np.einsum("fll->fl", sensitivity(gains)) - 1.0)


def first_lines(low: float, high: float, poles: Complex) -> Real:
    """Return lines between two frequencies, more of them near poles [Hz]; (n_freq,).

    Args:
        low: [Hz].
        high: [Hz].
        poles: with loops open and closed [rad/s]; (n_pole,).
    """
    count = int(np.ceil(LINE_SETTINGS.lines_per_decade * np.log10(high / low))) + 2
    oscillating = poles[poles.imag > 0]
    centre = oscillating.imag / (2 * np.pi)
    width = np.abs(oscillating.real) / (2 * np.pi)
    width = np.clip(width, _MIN_POLE_DAMPING * centre, centre / 2)
    near = (centre[:, None] + width[:, None] * _NEAR_POLES).ravel()
    lines: Real = np.unique(
        np.concatenate([np.geomspace(low, high, count), near[(near > low) & (near < high)]])
    )
    return lines


def follow_loop_gain(gain_of: LoopGainOf, freq_hz: Real) -> tuple[Real, Complex]:
    """Return lines that follow the gains of all loops, and GK there.

    Args:
        gain_of: GK at any lines.
        freq_hz: lines to begin with, rising [Hz].

    Returns:
        (n_freq,), (n_freq, n_loop, n_loop).
    """
    freq, gains = freq_hz, gain_of(freq_hz)
    for _ in range(LINE_SETTINGS.halvings):
        coarse = _coarse_steps(single_loop_gains(gains))
        if not len(coarse):
            break
        between = np.sqrt(freq[coarse] * freq[coarse + 1])
        order = np.argsort(np.append(freq, between), kind="stable")
        freq = np.append(freq, between)[order]
        gains = np.concatenate([gains, gain_of(between)])[order]
    return freq, gains


def _coarse_steps(single: Complex) -> Integers:
    """Return the steps between lines in which some loop gain moves too far."""
    before, after = single[:-1], single[1:]
    distance = np.minimum(np.abs(1 + before), np.abs(1 + after))
    is_far = np.abs(after - before) > LINE_SETTINGS.max_step * distance
    is_turned = np.abs(np.angle(after * before.conj())) > LINE_SETTINGS.max_turn_rad
    is_seen = np.maximum(np.abs(before), np.abs(after)) > LINE_SETTINGS.min_size
    steps: Integers = np.flatnonzero(((is_far | is_turned) & is_seen).any(axis=1))
    return steps


def find_crossings(
    value_of: Callable[[Real], Real], freq_hz: Real, values: Real, brackets: Integers
) -> Real:
    """Return the frequencies at which a value changes its sign [Hz]; (n_bracket,).

    Args:
        value_of: the value at one frequency for each bracket; (n_bracket,).
        freq_hz: lines [Hz]; (n_freq,).
        values: there; (n_freq,).
        brackets: numbers of the lines after which the sign changes; (n_bracket,).
    """
    logs = np.log(freq_hz)
    left, right = logs[brackets], logs[brackets + 1]
    low, high = values[brackets].copy(), values[brackets + 1].copy()
    guess, stayed = left, np.zeros(len(brackets))
    for _ in range(LINE_SETTINGS.crossing_rounds if len(brackets) else 0):
        guess = (left * high - right * low) / (high - low)
        value = value_of(np.exp(guess))
        is_left = np.sign(value) == np.sign(low)
        # An end that stays twice counts half, so that it moves too.
        high = np.where(is_left, np.where(stayed > 0, high / 2, high), value)
        low = np.where(is_left, value, np.where(stayed < 0, low / 2, low))
        left, right = np.where(is_left, guess, left), np.where(is_left, right, guess)
        stayed = np.where(is_left, 1.0, -1.0)
        if (np.abs(value) < LINE_SETTINGS.crossing_tolerance).all():
            break
    crossings: Real = np.exp(guess)
    return crossings


def find_peak(value_of: Callable[[Real], Real], freq_hz: Real, values: Real) -> tuple[float, float]:
    """Return the largest value and its frequency [Hz].

    Args:
        value_of: the value at lines [Hz].
        freq_hz: lines that follow it [Hz]; (n_freq,).
        values: there; (n_freq,).
    """
    best = int(np.argmax(values))
    peak, at = float(values[best]), float(freq_hz[best])
    low, high = freq_hz[max(0, best - 1)], freq_hz[min(len(freq_hz) - 1, best + 1)]
    for _ in range(LINE_SETTINGS.peak_rounds):
        lines = np.linspace(low, high, LINE_SETTINGS.peak_lines)
        finer = value_of(lines)
        best = int(np.argmax(finer))
        if finer[best] > peak:
            peak, at = float(finer[best]), float(lines[best])
        low, high = lines[max(0, best - 1)], lines[min(len(lines) - 1, best + 1)]
    return peak, at
