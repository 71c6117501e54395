"""Amplitude spectral densities of hits and of the noise before them.

Force and motion in time, thinned out for pictures (seed, fig. 1.5a).
"""

from itertools import pairwise

import numpy as np
import scipy.fft

from identification.hits.blocks import Blocks, quiet_samples
from identification.hits.detection import Blow
from identification.words import Real, Records, SignalTraces, SpectralDensities

_MIN_NOISE_SAMPLES = 64  # samples before the hits, for a spectrum of the noise
_SMOOTHING_SHARE = 8  # the spectrum of the noise is smoothed over 1/8 of its lines to each side


def hit_densities(blocks: Blocks) -> SpectralDensities:
    """Compute the amplitude spectral densities of force and motion from the blocks of hits.

    They are the root of the mean over hits of 2 dt |X|^2 / N, where ``X`` is the sum of
    x exp(-i w t); the factor 2 is absent at 0 Hz and at half the sampling rate. A transient has an
    energy, not a power, so these densities depend on the length of the block.
    """
    n_sample, rate = blocks.plan.block, blocks.records.rate_hz
    factor = np.full(n_sample // 2 + 1, 2.0 / (rate * n_sample))
    factor[0] /= 2
    factor[-1] /= 2  # the block is even, so the last line is half the sampling rate
    force = (np.abs(scipy.fft.rfft(blocks.force)) ** 2).mean(axis=0)
    motion = (np.abs(scipy.fft.rfft(blocks.motion)) ** 2).mean(axis=0)
    freq = np.arange(len(factor)) * rate / n_sample
    return SpectralDensities(freq, np.sqrt(factor * force), np.sqrt(factor * motion).T)


def noise_densities(
    records: Records, blows: tuple[Blow, ...], block: int
) -> SpectralDensities | None:
    """Estimate the amplitude spectral densities of the noise before the first hit of each record.

    This is Welch's method with Hann windows that overlap by half (Bendat and Piersol 2010,
    ch. 11.5). A window is as long as the longest quiet part, and at most a block; records with a
    shorter quiet part are left out.

    Args:
        blows: hits of the records.
        block: length of a block [samples].

    Returns:
        The densities, or None if fewer than 64 samples are quiet in every record.
    """
    # scipy.signal imports scipy.stats, which takes nearly a second and serves only this function.
    from scipy.signal import welch  # noqa: PLC0415

    quiet = quiet_samples(blows, *records.force.shape)
    length = min(max(quiet), block)
    if length < _MIN_NOISE_SAMPLES:
        return None
    freq, sums, count = np.zeros(0), [], 0
    for record, available in enumerate(quiet):
        if available < length:
            continue
        signals = np.vstack(
            [records.force[record, :available], records.motion[record, :, :available]]
        )
        freq, power = welch(signals, records.rate_hz, nperseg=length)
        weight = max(available // length, 1)
        sums.append(weight * power)
        count += weight
    density: Real = np.sqrt(np.sum(sums, axis=0) / count)
    return SpectralDensities(freq, density[0], density[1:].T)


def noise_powers(noise: SpectralDensities | None, freq_hz: Real) -> tuple[Real, Real] | None:
    """Interpolate smooth noise powers at the lines of the FRFs, for the noise ratio of Hv.

    The logarithm of each density is smoothed by a running mean over an eighth of the lines to each
    side: single lines scatter, and one mean over all lines would ignore the colour of the noise.

    Args:
        noise: densities of the noise, or None.
        freq_hz: frequencies of the FRFs [Hz]; (n_freq,).

    Returns:
        Powers of force (n_freq,) and motion (n_freq, n_out); None without noise at every line.
    """
    if noise is None or not (noise.force[1:] > 0).all() or not (noise.motion[1:] > 0).all():
        return None
    logs = np.log(
        np.column_stack([noise.force, noise.motion])[1:]
    )  # 0 Hz left out: Welch removes the mean
    width = max(len(logs) // _SMOOTHING_SHARE, 1)
    padded = np.pad(logs, ((width, width), (0, 0)), mode="edge")
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    smooth = np.stack([np.convolve(c, kernel, "valid") for c in padded.T], axis=1)
    powers = np.stack([np.exp(2 * np.interp(freq_hz, noise.freq_hz[1:], c)) for c in smooth.T])
    return powers[0], powers[1:].T


_MAX_POINTS = 1200  # of a curve: as many as a picture has pixels


def record_traces(blocks: Blocks) -> tuple[SignalTraces, SignalTraces]:
    """Return the signals as recorded: the record of the first block, and that block.

    Args:
        blocks: blocks of at least one hit.
    """
    records, record, start = blocks.records, blocks.blows[0].main.record, blocks.starts[0]
    signals = np.vstack([records.force[record], records.motion[record]])
    parts = (slice(0, signals.shape[1]), slice(start, start + blocks.plan.block))
    whole, block = (_traces(signals, part, record, records.rate_hz) for part in parts)
    return whole, block


def _traces(signals: Real, part: slice, record: int, rate_hz: float) -> SignalTraces:
    positions, values = envelope(signals[:, part], _MAX_POINTS)
    time = (part.start + positions) / rate_hz
    return SignalTraces(record + 1, time, values[0], values[1:].T)


def envelope(signals: Real, limit: int) -> tuple[Real, Real]:
    """Thin out signals so that no peak is lost: least and largest value of each interval.

    Both values stand in the order in which they occur. Signals with few samples stay as they are.

    Args:
        signals: samples; (n_signal, n_sample).
        limit: largest number of points, even.

    Returns:
        Positions of the points [samples] (n_point,), and values (n_signal, n_point).
    """
    count = signals.shape[1]
    if count <= limit:
        return np.arange(count, dtype=float), signals
    edges = np.linspace(0, count, limit // 2 + 1).astype(int)
    values = np.empty((len(signals), limit))
    for k, (first, last) in enumerate(pairwise(edges.tolist())):
        interval = signals[:, first:last]
        low, high = interval.min(axis=1), interval.max(axis=1)
        is_falling = interval.argmax(axis=1) < interval.argmin(axis=1)
        values[:, 2 * k] = np.where(is_falling, high, low)
        values[:, 2 * k + 1] = np.where(is_falling, low, high)
    middles = (edges[:-1] + edges[1:]) / 2
    return np.column_stack([edges[:-1], middles]).ravel(), values
