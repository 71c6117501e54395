"""Frequency lines at which a loop gain is known closely enough for its margins.

A curve L(i w) is followed until neighbouring lines lie close together as seen from the critical
point -1, and in phase. All crossings and peaks are then zoomed in together, since a call of the
model costs more than its lines: each round divides every interval evenly, keeps the part with the
change of sign or the largest value, and the last one ends with a secant.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Integers, Real

LoopGainOf = Callable[[Real], Complex]
"""Returns the loop gains GK (n_freq, n_loop, n_loop) at lines [Hz] (n_freq,)."""


@dataclass(frozen=True)
class LineSettings:
    """Constants of the search for lines.

    Args:
        lines_per_decade: at the beginning; further ones follow where they are needed.
        max_step: of L between lines, in units of its distance from -1: |S| changes as much.
        max_turn_rad: of L between lines, so that no crossing of the real axis is jumped over.
        min_size: of L below which its turns do not matter: gain margins beyond 60 dB.
        max_parts: into which a step is divided at once.
        rounds: of dividing steps; five reach a millionth of a step.
        zoom_rounds: of crossings and peaks.
        zoom_parts: of an interval; three rounds and the secant reach 1e-9 of a frequency.
    """

    lines_per_decade: int = 60
    max_step: float = 0.25
    max_turn_rad: float = 0.25
    min_size: float = 1e-3
    max_parts: int = 16
    rounds: int = 5
    zoom_rounds: int = 3
    zoom_parts: int = 16


LINE_SETTINGS = LineSettings()
# Distances of lines from a pole in half widths of its resonance.
_NEAR_POLES = np.tan(np.linspace(-1.5, 1.5, 11))
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
    return np.unique(
        np.concatenate([np.geomspace(low, high, count), near[(near > low) & (near < high)]])
    )


def follow_loop_gain(gain_of: LoopGainOf, freq_hz: Real) -> tuple[Real, Complex]:
    """Return lines that follow the gains of all loops, and GK there.

    Args:
        gain_of: GK at any lines.
        freq_hz: lines to begin with, rising [Hz].

    Returns:
        (n_freq,), (n_freq, n_loop, n_loop).
    """
    freq, gains = freq_hz, gain_of(freq_hz)
    for _ in range(LINE_SETTINGS.rounds):
        parts = _parts_of_steps(single_loop_gains(gains))
        coarse = np.flatnonzero(parts > 1)
        if not len(coarse):
            break
        between = np.concatenate(
            [np.geomspace(freq[k], freq[k + 1], parts[k] + 1)[1:-1] for k in coarse]
        )
        order = np.argsort(np.append(freq, between), kind="stable")
        freq = np.append(freq, between)[order]
        gains = np.concatenate([gains, gain_of(between)])[order]
    return freq, gains


def _parts_of_steps(single: Complex) -> Integers:
    """Return into how many parts each step between lines is to be divided; (n_freq - 1,)."""
    before, after = single[:-1], single[1:]
    distance = np.minimum(np.abs(1 + before), np.abs(1 + after))
    distance = np.maximum(distance, np.finfo(float).tiny)
    steps = np.abs(after - before) / distance / LINE_SETTINGS.max_step
    turns = np.abs(np.angle(after * before.conj())) / LINE_SETTINGS.max_turn_rad
    is_seen = np.maximum(np.abs(before), np.abs(after)) > LINE_SETTINGS.min_size
    needed = np.where(is_seen, np.maximum(steps, turns), 0.0).max(axis=1)
    return np.ceil(np.clip(needed, 1, LINE_SETTINGS.max_parts)).astype(int)


@dataclass(frozen=True, eq=False)
class LineInterval:
    """A crossing of zero, or a peak, of a value of the loop gains.

    Args:
        value_of: the value by GK; (n_freq,).
        low: end of the interval [Hz].
        high: other end [Hz].
        is_peak: whether the largest value is sought instead of a change of sign.
    """

    value_of: Callable[[Complex], Real]
    low: float
    high: float
    is_peak: bool = False


def crossings_of(
    value_of: Callable[[Complex], Real], freq_hz: Real, steps: Integers
) -> list[LineInterval]:
    """Return a search in each step of the lines in which a value changes its sign."""
    return [LineInterval(value_of, float(freq_hz[k]), float(freq_hz[k + 1])) for k in steps]


def peak_of(value_of: Callable[[Complex], Real], freq_hz: Real, values: Real) -> LineInterval:
    """Return the search of a peak about the largest value at the lines."""
    best = int(np.argmax(values))
    low, high = freq_hz[max(0, best - 1)], freq_hz[min(len(freq_hz) - 1, best + 1)]
    return LineInterval(value_of, float(low), float(high), is_peak=True)


def zoom_in(gain_of: LoopGainOf, searches: Sequence[LineInterval]) -> Real:
    """Return the frequencies of crossings and peaks [Hz]; (n_search,).

    Args:
        gain_of: GK at any lines [Hz].
        searches: each in its interval.
    """
    ends = np.array([[search.low, search.high] for search in searches]).reshape(-1, 2)
    places: Real = ends.mean(axis=1)
    for _ in range(LINE_SETTINGS.zoom_rounds if len(searches) else 0):
        lines = np.linspace(ends[:, 0], ends[:, 1], LINE_SETTINGS.zoom_parts + 1, axis=1)
        gains = gain_of(lines.ravel())
        gains = gains.reshape(*lines.shape, *gains.shape[1:])
        for number, search in enumerate(searches):
            values = search.value_of(gains[number])
            ends[number], places[number] = _narrow(search, lines[number], values)
    return places


def _narrow(search: LineInterval, lines: Real, values: Real) -> tuple[Real, float]:
    """Return the part of an interval with the crossing or peak, and the best place in it [Hz]."""
    if search.is_peak:
        best = int(np.argmax(values))
        part = lines[[max(0, best - 1), min(len(lines) - 1, best + 1)]]
        return part, float(lines[best])
    changes = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
    k = int(changes[0]) if len(changes) else int(np.argmin(np.abs(values[:-1])))
    slope = values[k + 1] - values[k]
    share = -values[k] / slope if slope else 0.0
    place = lines[k] + np.clip(share, 0.0, 1.0) * (lines[k + 1] - lines[k])
    return lines[k : k + 2], float(place)
