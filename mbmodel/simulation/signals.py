"""Input signals: step, chirp, and random noise of a given power density."""

import numpy as np

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
    step: Real = height * (1 - np.cos(np.pi * phase)) / 2
    return step


def chirp_signal(time_s: Real, height: float, band: tuple[float, float]) -> Real:
    """Return a sine whose frequency rises linearly through a band, faded in and out; (n_time,)."""
    start, length = _START_SHARE * time_s[-1], (1 - 2 * _START_SHARE) * time_s[-1]
    moved = np.clip(time_s - start, 0.0, length)
    low, high = band
    phase = 2 * np.pi * (low * moved + (high - low) * moved**2 / (2 * length))
    edge = np.minimum(moved, length - moved) / (_START_SHARE * time_s[-1])
    fade = np.sin(np.pi / 2 * np.clip(edge, 0.0, 1.0)) ** 2
    chirp: Real = height * fade * np.sin(phase)
    return chirp


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
    signal: Real = np.fft.irfft(spectrum, count)
    return signal


def flat_density(rms: float, band: tuple[float, float]) -> tuple[Real, Real]:
    """Return frequencies and one-sided power density of noise of an rms value in a band."""
    low, high = band
    return np.array([low, high]), np.full(2, rms**2 / (high - low))
