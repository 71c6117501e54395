"""Amplitude spectral densities of hits, and of the noise before them."""

import numpy as np
import scipy.fft

from identification.hits.blocks import Blocks, quiet_samples
from identification.hits.detection import Blow
from identification.words import Densities, Real, Records

_LEAST = 64  # samples of noise that make a spectrum


def hit_densities(blocks: Blocks) -> Densities:
    """Root of the mean over hits of 2 dt |X|^2 / N, X the sum of x exp(-i w t); 0 Hz without the 2.

    A transient has an energy, not a power: these densities are those of its block.
    """
    n_sample, rate = blocks.plan.block, blocks.records.rate_hz
    factor = np.full(n_sample // 2 + 1, 2.0 / (rate * n_sample))
    factor[0] /= 2
    factor[-1] /= 2  # the block is even, so that the last line is half the rate
    force = (np.abs(scipy.fft.rfft(blocks.force)) ** 2).mean(axis=0)
    motion = (np.abs(scipy.fft.rfft(blocks.motion)) ** 2).mean(axis=0)
    freq = np.arange(len(factor)) * rate / n_sample
    return Densities(freq, np.sqrt(factor * force), np.sqrt(factor * motion).T)


def noise_densities(records: Records, blows: tuple[Blow, ...], block: int) -> Densities | None:
    """Root of Welch's estimate of what is before the first hit of each record; None if too short.

    Hann windows of at most a block, half overlapping, of every record that has as much as the
    longest of a quarter of the longest (Bendat and Piersol 2010, ch. 11.5).
    """
    # With scipy.stats nearly a second of every start, which only this needs.
    from scipy.signal import welch  # noqa: PLC0415

    quiet = quiet_samples(blows, *records.force.shape)
    length = min(max(quiet), block)
    if length < _LEAST:
        return None
    freq, sums, count = np.zeros(0), [], 0
    for record, available in enumerate(quiet):
        if available < length:
            continue
        both = np.vstack([records.force[record, :available], records.motion[record, :, :available]])
        freq, power = welch(both, records.rate_hz, nperseg=length)
        weight = max(available // length, 1)
        sums.append(weight * power)
        count += weight
    density: Real = np.sqrt(np.sum(sums, axis=0) / count)
    return Densities(freq, density[0], density[1:].T)


def noise_powers(noise: Densities | None, freq_hz: Real) -> tuple[Real, Real] | None:
    """Powers of the noise at other lines, for the ratio that Hv needs; (n_freq,), (n_freq, n_out).

    The median over lines of each channel's density would ignore its colour, the single lines
    scatter: the logarithm is smoothed over an eighth of the lines.
    """
    if noise is None or not (noise.force[1:] > 0).all() or not (noise.motion[1:] > 0).all():
        return None
    logs = np.log(np.column_stack([noise.force, noise.motion])[1:])  # the mean was taken off
    width = max(len(logs) // 8, 1)
    padded = np.pad(logs, ((width, width), (0, 0)), mode="edge")
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    smooth = np.stack([np.convolve(c, kernel, "valid") for c in padded.T], axis=1)
    powers = np.stack([np.exp(2 * np.interp(freq_hz, noise.freq_hz[1:], c)) for c in smooth.T])
    return powers[0], powers[1:].T
