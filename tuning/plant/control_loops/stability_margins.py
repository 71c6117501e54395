r"""Stability margins of closed loops: gain, phase, delay and modulus margin.

A loop u = -K y around the plant G has the loop gain L = G K and the critical point -1. With several
loops, L is that of one loop with all others closed, L = 1 / S_ll - 1, S = (1 + GK)^-1. Then

    gain margin       1 / |L| where L is real and in (-1, 0), the smallest
    gain reduction    1 / |L| where L is real and below -1, the largest
    phase margin      angle of -L where |L| = 1, the one of smallest size
    delay margin      that angle, from 0 to 2 pi, over w, the smallest
    modulus margin    1 / max |S|, the distance of L from -1

A loop without any gain has no margins: nothing that is done to it changes a loop.

(Skogestad and Postlethwaite 2005, ch. 2.4). A stable loop stays stable when its gain or phase
changes by less, and any plant whose L moves by less than the modulus margin is stable too.

The gain of a sampled loop ends at half of the sampling rate, where it is real.

Several loops that change at once have the modulus margin 1 / max sigma(D S D^-1), whose diagonal D
takes out the units of the signals (``scaled_singular_values``).

Stability margins of one loop, and of all loops at once.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from tuning.plant.control_loops.loop_gain_lines import (
    LINE_SETTINGS,
    LineInterval,
    LoopGainOf,
    crossings_of,
    follow_loop_gain,
    peak_of,
    sensitivity,
    single_loop_gains,
    zoom_in,
)
from tuning.plant.control_loops.scaled_singular_values import (
    scaled_singular_values,
    singular_values,
)


@dataclass(frozen=True)
class Margin:
    """A margin and its frequency.

    Args:
        value: infinite (or 0, of a gain reduction) where no change of this kind is critical; of
            gains up to a factor of 1000.
        freq_hz: at which it is taken [Hz]; not a number without one.
    """

    value: float
    freq_hz: float = float("nan")

    @property
    def is_finite(self) -> bool:
        """Whether a change of this kind is critical."""
        return bool(np.isfinite(self.value) and np.isfinite(self.freq_hz))

    @property
    def stated(self) -> float | None:
        """Value as files state it; None where no change of this kind is critical."""
        return self.value if self.is_finite else None


@dataclass(frozen=True, eq=False)
class LoopMargins:
    """Margins of one loop, all others closed.

    Args:
        crossover: frequency above which |L| stays below one [Hz]; its value is the frequency.
        bandwidth: lowest frequency at which |S| rises above 1 / sqrt(2) [Hz], likewise.
        gain: factor above one by which the gain may rise.
        reduction: factor below one to which it may fall; 0 if it may vanish.
        phase: [deg]; negative where phase lead is critical.
        delay: that may be added [s].
        modulus: smallest distance of L from -1.
        gain_crossovers: frequencies with |L| = 1 [Hz], and phase margins there [deg]; (n, 2).
        phase_crossovers: frequencies with L real and negative [Hz], and 1 / |L| there; (n, 2).
    """

    crossover: Margin
    bandwidth: Margin
    gain: Margin
    reduction: Margin
    phase: Margin
    delay: Margin
    modulus: Margin
    gain_crossovers: Real
    phase_crossovers: Real

    def state(self, names: Iterable[str]) -> dict[str, float | None]:
        """Return some margins by name; None where no change of this kind is critical."""
        return {name: getattr(self, name).stated for name in names}

    def __repr__(self) -> str:
        """Return the margins in one line."""
        crossover = self.crossover
        at = f"crossover {crossover.value:.4g} Hz" if crossover.is_finite else "no crossover"
        return (
            f"gain {self.gain.value:.3g}, phase {self.phase.value:.3g} deg, delay "
            f"{self.delay.value:.3g} s, modulus {self.modulus.value:.3g} (|S| at most "
            f"{1 / self.modulus.value:.3g}), {at}"
        )


@dataclass(frozen=True, eq=False)
class AllMargins:
    """Margins of each loop, and of all at once.

    Args:
        loops: of each loop; n_loop.
        modulus: of all loops at once, their units scaled out.
        singular: 1 / max sigma(S) in SI units of the signals.
        freq_hz: lines that follow the loop gains [Hz]; (n_freq,).
        gains: GK there; (n_freq, n_loop, n_loop).
    """

    loops: tuple[LoopMargins, ...]
    modulus: Margin
    singular: Margin
    freq_hz: Real
    gains: Complex


# A loop gain whose first line is real and negative crosses the axis at 0 Hz: within this angle
# [rad], and if it is neither that of an integrator nor nothing.
_REAL_ANGLE_RAD, _STATIC_SIZES = 0.02, (1e-3, 1e3)

_BANDWIDTH_SIZE = float(np.sqrt(0.5))  # of S: -3 dB
_TINY = float(np.finfo(float).tiny)  # stands for a size of zero in logarithms
_NO_LIMIT = Margin(float("inf"))
_NONE = Margin(1.0)  # modulus of a loop without gain: |S| is 1 everywhere


def stability_margins(
    gain_of: LoopGainOf, freq_hz: Real, *, is_sampled: bool = False
) -> AllMargins:
    """Return the margins of closed loops that are stable.

    Args:
        gain_of: GK at any lines [Hz]; (n_freq, n_loop, n_loop).
        freq_hz: lines to begin with, from far below to far above all crossings [Hz].
        is_sampled: whether the last line is half of the sampling rate.
    """
    freq, gains = follow_loop_gain(gain_of, freq_hz)
    count = gains.shape[-1]
    groups = [_searches_of_loop(freq, gains, number) for number in range(count)]
    at_once = [peak_of(size, freq, size(gains)) for size in _SIZES_AT_ONCE[: 2 * (count > 1)]]
    searches = [search for group in groups for kind in group for search in kind] + at_once
    places = zoom_in(gain_of, searches)
    reached = gain_of(places)
    loops, start = [], 0
    for number, group in enumerate(groups):
        parts = []
        for kind in group:
            span = slice(start, start + len(kind))
            start += len(kind)
            parts.append((places[span], single_loop_gains(reached[span])[:, number]))
        lowest, highest = (single_loop_gains(gains[[k]])[0, number] for k in (0, -1))
        last = _LastLine(complex(highest), float(freq[-1]), is_sampled)
        loops.append(_margins_of_loop(parts, complex(lowest), last))
    if count == 1:
        return AllMargins(tuple(loops), loops[0].modulus, loops[0].modulus, freq, gains)
    scaled, singular = (
        Margin(1 / float(size(reached[[k]])[0]), float(places[k]))
        for size, k in zip(_SIZES_AT_ONCE, (start, start + 1), strict=True)
    )
    return AllMargins(tuple(loops), scaled, singular, freq, gains)


def _scaled_sensitivity(gains: Complex) -> Real:
    """Return sigma(D S D^-1) by GK; (n_freq,)."""
    return scaled_singular_values(sensitivity(gains))


def _plain_sensitivity(gains: Complex) -> Real:
    """Return sigma(S) by GK; (n_freq,)."""
    return singular_values(sensitivity(gains))


_SIZES_AT_ONCE = (_scaled_sensitivity, _plain_sensitivity)


def _searches_of_loop(freq: Real, gains: Complex, number: int) -> tuple[list[LineInterval], ...]:
    """Return searches of |L| = 1, falling and rising, of real L, of the bandwidth and of |S|."""

    def log_size(some: Complex) -> Real:
        return np.log(np.maximum(np.abs(single_loop_gains(some)[:, number]), _TINY))

    def turn(some: Complex) -> Real:
        return np.angle(-single_loop_gains(some)[:, number])

    def size_of_sensitivity(some: Complex) -> Real:
        return 1 / np.abs(1 + single_loop_gains(some)[:, number])

    def beyond_bandwidth(some: Complex) -> Real:
        return size_of_sensitivity(some) - _BANDWIDTH_SIZE

    sizes, turns, closed = log_size(gains), turn(gains), size_of_sensitivity(gains)
    near = np.abs(turns) < np.pi / 2
    is_real = (np.sign(turns[:-1]) * np.sign(turns[1:]) < 0) & near[:-1] & near[1:]
    is_seen = np.maximum(sizes[:-1], sizes[1:]) > np.log(LINE_SETTINGS.min_size)
    above = closed >= _BANDWIDTH_SIZE
    return (
        crossings_of(log_size, freq, np.flatnonzero((sizes[:-1] > 0) & (sizes[1:] <= 0))),
        crossings_of(log_size, freq, np.flatnonzero((sizes[:-1] <= 0) & (sizes[1:] > 0))),
        crossings_of(turn, freq, np.flatnonzero(is_real & is_seen)),
        crossings_of(beyond_bandwidth, freq, np.flatnonzero(~above[:-1] & above[1:])[:1]),
        [peak_of(size_of_sensitivity, freq, closed)],
    )


@dataclass(frozen=True)
class _LastLine:
    """Loop gain at the highest line [Hz], and whether that is half of the sampling rate."""

    gain: complex
    freq_hz: float
    is_sampled: bool


def _margins_of_loop(
    parts: Sequence[tuple[Real, Complex]], lowest: complex, last: _LastLine
) -> LoopMargins:
    """Return the margins of one loop, all others closed.

    Args:
        parts: frequencies [Hz] and loop gains of each kind of ``_searches_of_loop``.
        lowest: loop gain at the lowest line.
        last: that at the highest line.
    """
    falling, rising, real_axis, bandwidth, peak = parts
    unity = np.concatenate([falling[0], rising[0]])
    order = np.argsort(unity)
    unity = unity[order]
    angles = np.angle(-np.concatenate([falling[1], rising[1]])[order])
    real, inverse = real_axis[0], 1 / np.abs(real_axis[1])
    ends = [(0.0, lowest), *([(last.freq_hz, last.gain)] if last.is_sampled else [])]
    smallest, largest = _STATIC_SIZES
    for freq, gain in ends:
        if abs(np.angle(-gain)) < _REAL_ANGLE_RAD and smallest < abs(gain) < largest:
            real, inverse = np.append(real, freq), np.append(inverse, 1 / abs(gain))
    delays = np.mod(angles, 2 * np.pi) / (2 * np.pi * unity)
    delay = _smallest(delays, unity, delays)
    if abs(last.gain) > 1:  # never below one: any further delay turns L around -1 somewhere
        delay = Margin(0.0, last.freq_hz)
    is_below = inverse < 1
    return LoopMargins(
        crossover=_smallest(falling[0], falling[0], -falling[0]),
        bandwidth=_smallest(bandwidth[0], bandwidth[0], bandwidth[0]),
        gain=_smallest(inverse[~is_below], real[~is_below], inverse[~is_below]),
        reduction=_smallest(inverse[is_below], real[is_below], -inverse[is_below])
        if is_below.any()
        else Margin(0.0),
        phase=_smallest(np.degrees(angles), unity, np.abs(angles)),
        delay=delay,
        modulus=Margin(float(np.abs(1 + peak[1][0])), float(peak[0][0])) if peak[1][0] else _NONE,
        gain_crossovers=np.column_stack([unity, np.degrees(angles)]),
        phase_crossovers=np.column_stack([real, inverse]),
    )


def _smallest(values: Real, freq_hz: Real, sizes: Real) -> Margin:
    """Return the value of smallest size with its frequency; infinite without any."""
    if not len(values):
        return _NO_LIMIT
    best = int(np.argmin(sizes))
    return Margin(float(values[best]), float(freq_hz[best]))
