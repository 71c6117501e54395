r"""Stability margins of closed loops: gain, phase, delay and modulus margin.

A loop u = -K y around the plant G has the loop gain L = G K and the critical point -1. With several
loops, L is that of one loop with all others closed, L = 1 / S_ll - 1, S = (1 + GK)^-1. Then

    gain margin       1 / |L| where L is real and in (-1, 0), the smallest
    gain reduction    1 / |L| where L is real and below -1, the largest
    phase margin      angle of -L where |L| = 1, the one of smallest size
    delay margin      that angle, from 0 to 2 pi, over w, the smallest
    modulus margin    1 / max |S|, the distance of L from -1

(Skogestad and Postlethwaite 2005, ch. 2.4). A stable loop stays stable when its gain or phase
changes by less, and any plant whose L moves by less than the modulus margin is stable too.

Several loops that change at once have the modulus margin 1 / max sigma(D S D^-1), whose diagonal D
takes out the units of the signals (``scaled_singular_values``).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from tuning.control_loops.loop_gain_lines import (
    LINE_SETTINGS,
    LoopGainOf,
    find_crossings,
    find_peak,
    follow_loop_gain,
    sensitivity,
    single_loop_gains,
)
from tuning.control_loops.scaled_singular_values import scaled_singular_values, singular_values

# A loop gain whose lowest line is real and negative crosses the axis at 0 Hz: within this angle
# [rad], and if it is neither that of an integrator nor nothing.
_REAL_ANGLE_RAD, _STATIC_SIZES = 0.02, (1e-3, 1e3)

_BANDWIDTH_SIZE = float(np.sqrt(0.5))  # of S: -3 dB


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


_NO_LIMIT = Margin(float("inf"))


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

    def __repr__(self) -> str:
        """Return the margins in one line."""
        return (
            f"gain {self.gain.value:.3g}, phase {self.phase.value:.3g} deg, delay "
            f"{self.delay.value:.3g} s, modulus {self.modulus.value:.3g} (|S| at most "
            f"{1 / self.modulus.value:.3g}), crossover {self.crossover.value:.4g} Hz"
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


def stability_margins(gain_of: LoopGainOf, freq_hz: Real) -> AllMargins:
    """Return the margins of closed loops that are stable.

    Args:
        gain_of: GK at any lines [Hz]; (n_freq, n_loop, n_loop).
        freq_hz: lines to begin with, from far below to far above all crossings [Hz].
    """
    freq, gains = follow_loop_gain(gain_of, freq_hz)
    count = gains.shape[-1]
    loops = tuple(_margins_of_loop(gain_of, freq, gains, number) for number in range(count))
    if count == 1:
        return AllMargins(loops, loops[0].modulus, loops[0].modulus, freq, gains)
    scaled, singular = (
        _margin_at_once(gain_of, freq, gains, of)
        for of in (scaled_singular_values, singular_values)
    )
    return AllMargins(loops, scaled, singular, freq, gains)


def _margin_at_once(
    gain_of: LoopGainOf, freq: Real, gains: Complex, size_of: Callable[[Complex], Real]
) -> Margin:
    """Return the modulus margin of all loops by a size of their sensitivity."""

    def size_at(lines: Real) -> Real:
        return size_of(sensitivity(gain_of(lines)))

    peak, at = find_peak(size_at, freq, size_of(sensitivity(gains)))
    return Margin(1 / peak, at)


def _margins_of_loop(gain_of: LoopGainOf, freq: Real, gains: Complex, number: int) -> LoopMargins:
    """Return the margins of one loop, all others closed."""

    def loop_gain(lines: Real) -> Complex:
        return single_loop_gains(gain_of(lines))[:, number]

    known = single_loop_gains(gains)[:, number]
    sizes = np.log(np.abs(known))
    brackets = np.flatnonzero(np.sign(sizes[:-1]) * np.sign(sizes[1:]) < 0)
    unity = find_crossings(lambda lines: np.log(np.abs(loop_gain(lines))), freq, sizes, brackets)
    falls = unity[sizes[brackets] > 0]
    angles = np.angle(-loop_gain(unity)) if len(unity) else np.zeros(0)

    turns = np.angle(-known)
    brackets = np.flatnonzero(
        (np.sign(turns[:-1]) * np.sign(turns[1:]) < 0)
        & (np.abs(turns[:-1]) < np.pi / 2)
        & (np.abs(turns[1:]) < np.pi / 2)
    )
    real = find_crossings(lambda lines: np.angle(-loop_gain(lines)), freq, turns, brackets)
    inverse = 1 / np.abs(loop_gain(real)) if len(real) else np.zeros(0)
    is_seen = inverse < 1 / LINE_SETTINGS.min_size
    real, inverse = real[is_seen], inverse[is_seen]
    smallest, largest = _STATIC_SIZES
    if abs(turns[0]) < _REAL_ANGLE_RAD and smallest < np.abs(known[0]) < largest:
        real, inverse = np.append(0.0, real), np.append(1 / np.abs(known[0]), inverse)

    def size_of_sensitivity(lines: Real) -> Real:
        return 1 / np.abs(1 + loop_gain(lines))

    closed = 1 / np.abs(1 + known)
    peak, at = find_peak(size_of_sensitivity, freq, closed)
    above = closed - _BANDWIDTH_SIZE
    rises = np.flatnonzero((above[:-1] < 0) & (above[1:] >= 0))[:1]
    bandwidth = find_crossings(
        lambda lines: size_of_sensitivity(lines) - _BANDWIDTH_SIZE, freq, above, rises
    )
    delays = np.mod(angles, 2 * np.pi) / (2 * np.pi * unity)
    delay = _smallest(delays, unity, delays)
    if sizes[-1] > 0:  # never below one: any further delay turns L around -1 somewhere
        delay = Margin(0.0, float(freq[-1]))
    return LoopMargins(
        crossover=_smallest(falls, falls, -falls),
        bandwidth=_smallest(bandwidth, bandwidth, bandwidth),
        gain=_smallest(inverse[inverse > 1], real[inverse > 1], inverse[inverse > 1]),
        reduction=_smallest(inverse[inverse < 1], real[inverse < 1], -inverse[inverse < 1])
        if (inverse < 1).any()
        else Margin(0.0),
        phase=_smallest(np.degrees(angles), unity, np.abs(angles)),
        delay=delay,
        modulus=Margin(1 / peak, at),
        gain_crossovers=np.column_stack([unity, np.degrees(angles)]),
        phase_crossovers=np.column_stack([real, inverse]),
    )


def _smallest(values: Real, freq_hz: Real, sizes: Real) -> Margin:
    """Return the value of smallest size with its frequency; infinite without any."""
    if not len(values):
        return _NO_LIMIT
    best = int(np.argmin(sizes))
    return Margin(float(values[best]), float(freq_hz[best]))
