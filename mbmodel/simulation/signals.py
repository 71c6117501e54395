r"""Input signals: step, point-to-point move, chirp, and random noise of a given power density.

A move of order n is a jump by the distance, averaged over times T_1 to T_n one after the other, so
that its derivative k is a piecewise polynomial whose largest value is D / (T_1 ... T_k) if every
time is at least the sum of those behind it. The innermost time is the longest that no limit
forbids, then the next one: the move of least time (Lambrechts, Boerlage and Steinbuch 2005).
"""

from collections.abc import Sequence
from itertools import product
from math import factorial, prod

import numpy as np
from scipy.optimize import brentq

from identification.words import Real, UsageError

_MIN_SIGNAL_SAMPLES, _MAX_SIGNAL_SAMPLES = 64, 10_000_000
_START_SHARE = 0.05  # of the duration, before a step and between a chirp and the ends
_RISE_SAMPLES = 8  # of a step: a jump between two samples has no band limit


def time_axis(duration_s: float, rate_hz: float) -> Real:
    """Return the instants of a signal [s]; (n_time,).

    Raises:
        UsageError: the signal is too short, or too long to be kept.
    """
    count = duration_s * rate_hz
    if not (rate_hz > 0 and _MIN_SIGNAL_SAMPLES <= count <= _MAX_SIGNAL_SAMPLES):
        raise UsageError(
            f"a signal of {duration_s:g} s at {rate_hz:g} Hz has {count:.4g} samples: give "
            f"{_MIN_SIGNAL_SAMPLES} to {_MAX_SIGNAL_SAMPLES:g}"
        )
    return np.arange(round(count) + 1) / rate_hz


def step_signal(time_s: Real, height: float) -> Real:
    """Return a step with a smooth rise over eight samples; (n_time,)."""
    rise = _RISE_SAMPLES * (time_s[1] - time_s[0])
    phase = np.clip((time_s - _START_SHARE * time_s[-1]) / rise, 0.0, 1.0)
    return height * (1 - np.cos(np.pi * phase)) / 2


def move_signal(
    time_s: Real,
    distance: float,
    limits: Sequence[float],
    derivative: int = 0,
    start_s: float | None = None,
) -> Real:
    """Return a point-to-point move of least time whose derivatives are limited; (n_time,).

    Args:
        time_s: instants [s]; (n_time,).
        distance: of the move.
        limits: of velocity, acceleration, jerk, and perhaps snap: the order of the move.
        derivative: of the move that is returned, below its order, for a feedforward.
        start_s: begin of the move [s]; None for 5 % of the time.

    Raises:
        UsageError: limits that are not above zero, a derivative that the move does not have, or a
            move that begins before the first instant or ends behind the last one.
    """
    if not limits or not all(np.isfinite(limit) and limit > 0 for limit in limits):
        raise UsageError(f"limits {list(limits)}: give numbers above 0, the velocity first")
    if derivative not in range(len(limits)):
        raise UsageError(
            f"derivative {derivative}: a move of {len(limits)} limits has those of order 0 to "
            f"{len(limits) - 1}"
        )
    if not np.isfinite(distance):
        raise UsageError(f"distance {distance}: give a finite number")
    if start_s is not None and not start_s >= time_s[0]:
        raise UsageError(f"the move begins at {start_s} s, before the signal: raise start_s")
    if distance == 0:
        return np.zeros(len(time_s))
    times = _averaging_times(abs(distance), limits)
    total = sum(times)
    start = time_s[0] + _START_SHARE * (time_s[-1] - time_s[0]) if start_s is None else start_s
    if start + total > time_s[-1]:
        raise UsageError(
            f"the move takes {total:.4g} s from {start:.4g} s on and ends behind the signal: raise "
            "the duration or the limits"
        )
    order, since = len(times) - derivative, np.clip(time_s - start, 0.0, total)
    is_late = since > total / 2  # the second half mirrors the first one, without lost digits
    early, values = np.where(is_late, total - since, since), np.zeros(len(time_s))
    for choice in product((0, 1), repeat=len(times)):
        shift = sum(time for time, chosen in zip(times, choice, strict=True) if chosen)
        values += (-1) ** sum(choice) * np.clip(early - shift, 0.0, None) ** order
    values *= distance / prod(times) / factorial(order)
    mirrored: Real = (distance if derivative == 0 else 0.0) - (-1) ** derivative * values
    return np.where(is_late, mirrored, values)


def _averaging_times(distance: float, limits: Sequence[float]) -> list[float]:
    """Return the times T_1 to T_n over which a move is averaged [s]."""
    bounds, times = [distance, *limits], list[float]()
    for number in range(len(limits), 0, -1):
        least = sum(times)

        def excess(
            time_s: float, number: int = number, inner: tuple[float, ...] = tuple(times)
        ) -> float:
            """Return the largest logarithm of a derivative over its limit."""
            chain = [time_s, *inner]
            while len(chain) < len(limits):
                chain.insert(0, sum(chain))
            peaks = [limits[-1] * prod(chain[k:]) / bounds[k] for k in range(number)]
            return float(np.log(max(peaks)))

        high = max(least, 1e-9)
        while excess(high) < 0:
            high *= 2
        low = max(least, high * 1e-9)
        is_least = excess(low) >= 0
        times.insert(
            0, low if is_least else float(brentq(excess, low, high, xtol=1e-15, rtol=1e-13))
        )
    return times


def chirp_signal(time_s: Real, height: float, band: tuple[float, float]) -> Real:
    """Return a sine whose frequency rises linearly through a band, faded in and out; (n_time,)."""
    start, length = _START_SHARE * time_s[-1], (1 - 2 * _START_SHARE) * time_s[-1]
    moved = np.clip(time_s - start, 0.0, length)
    low, high = band
    phase = 2 * np.pi * (low * moved + (high - low) * moved**2 / (2 * length))
    edge = np.minimum(moved, length - moved) / (_START_SHARE * time_s[-1])
    fade = np.sin(np.pi / 2 * np.clip(edge, 0.0, 1.0)) ** 2
    return height * fade * np.sin(phase)


def noise_signal(time_s: Real, freq_hz: Real, density: Real, random: np.random.Generator) -> Real:
    """Return Gaussian noise of a one-sided power density, linear between its frequencies.

    Args:
        time_s: evenly spaced [s]; (n_time,).
        freq_hz: rising [Hz]; (n,). The density is zero outside.
        density: [unit^2/Hz]; (n,).

    Returns:
        (n_time,).
    """
    step, count = time_s[1] - time_s[0], len(time_s)
    lines = np.fft.rfftfreq(count, step)
    power = np.interp(lines, freq_hz, density, left=0.0, right=0.0)
    # The mean square of the signal is the sum of power over lines of width 1 / (n dt).
    size = np.sqrt(power * count / (2 * step) / 2)
    spectrum = size * (random.standard_normal(len(lines)) + 1j * random.standard_normal(len(lines)))
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum, count)


def flat_density(rms: float, band: tuple[float, float]) -> tuple[Real, Real]:
    """Return frequencies and one-sided power density of noise of an rms value in a band."""
    low, high = band
    return np.array([low, high]), np.full(2, rms**2 / (high - low))
