r"""Spectra of impacts whose force nobody measured.

From the impact on a structure decays freely, a sum of exponentials A exp(lambda t), whose spectrum

    Y(f) = integral_0^T y(t) exp(-i 2 pi f t) dt = sum A / (i 2 pi f - lambda) + ..

has the shapes of its modes in the residues A = phi gamma, one factor gamma for each impact and mode
(eq. 10 with f unknown): all that ratios of channels need. The noise of a line is that of the
record before the impact, of the same length of time. What sways below the band (ropes) decays for
long and says nothing in it: the length is that of what is heard in the band.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, czt, sosfiltfilt

from identification.impacts.common_clock import Struck
from identification.words import Complex, Dof, InputError, Real

_LEAST_BEFORE = 32  # samples, for the noise to be known
_ENDED = 1.5  # times the energy before the impact: it has died away


@dataclass(frozen=True, eq=False)
class ImpactSpectra:
    """Spectra of several impacts at the same channels.

    Args:
        sources: the files; n_impact.
        dofs: of the channels; n_channel.
        freq_hz: lines, evenly spaced; (n_freq,).
        values: Y [m/s2 s]; (n_freq, n_channel, n_impact).
        variance: of their noise, E|error|^2; (n_channel, n_impact).
    """

    sources: tuple[str, ...]
    dofs: tuple[Dof, ...]
    freq_hz: Real
    values: Complex
    variance: Real


def impact_spectra(
    impacts: Sequence[Struck], band: tuple[float, float], *, finer: int = 1
) -> ImpactSpectra:
    """Spectra on lines that all impacts share.

    The record from the impact on is cut where the slowest of them has died away, so that the lines
    are as far apart as there is something to see; all are cut at the same length.

    Args:
        impacts: on common clocks, with the same channels.
        band: lowest and highest line [Hz].
        finer: so many times as close as independent lines, to look at: what lies between these is
            exact, for the decay is complete, and tells nothing new.

    Raises:
        InputError: impacts with other channels, a record too short before the impact, a band
            above half the rate.
    """
    first = impacts[0]
    for one in impacts[1:]:
        if set(one.dofs) != set(first.dofs):
            other = sorted(map(str, set(one.dofs) ^ set(first.dofs)))
            raise InputError(
                f"{one.source} and {first.source} differ in {', '.join(other)}. Impacts must be "
                "read by the same channels."
            )
    slowest = min(one.rate_hz for one in impacts)
    if band[1] > slowest / 2:
        raise InputError(
            f"the band ends at {band[1]:g} Hz, above half of the {slowest:.4g} samples a second."
        )
    length = min(max(_lasts(one, band) for one in impacts), *(_seconds(one) for one in impacts))
    every = finer * length
    lines = np.arange(np.ceil(band[0] * every), np.floor(band[1] * every) + 1) / every
    if len(lines) < 8 * finer:
        raise InputError(
            f"the impacts last {length:.3g} s, {len(lines) // finer} lines between {band[0]:g} and "
            f"{band[1]:g} Hz. Record for longer, or widen the band."
        )
    values = np.zeros((len(lines), len(first.dofs), len(impacts)), complex)
    variance = np.zeros((len(first.dofs), len(impacts)))
    for k, one in enumerate(impacts):
        order = [one.dofs.index(dof) for dof in first.dofs]
        count = int(length * one.rate_hz)
        after = one.after[order, :count]
        level = one.before[order].mean(axis=1, keepdims=True) if one.before.size else 0.0
        values[:, :, k] = _transformed(after - level, one.rate_hz, lines)
        variance[:, k] = _noise(one.before[order], one.rate_hz, lines) * length
    return ImpactSpectra(tuple(one.source for one in impacts), first.dofs, lines, values, variance)


def smoothed(values: Real, freq_hz: Real, width_hz: float) -> Real:
    """Sliding average over a width in Hz; the ends by what there is.

    Args:
        values: amplitudes; (n_freq, ...).
        freq_hz: evenly spaced lines.
        width_hz: of the average; below a line's spacing nothing changes.
    """
    spacing = float(freq_hz[1] - freq_hz[0])
    half = int(width_hz / spacing / 2)
    total = np.cumsum(np.concatenate([np.zeros((1, *values.shape[1:])), values]), axis=0)
    place = np.arange(len(values))
    low, high = np.maximum(place - half, 0), np.minimum(place + half + 1, len(values))
    count = (high - low).reshape(-1, *(1,) * (values.ndim - 1))
    averaged: Real = (total[high] - total[low]) / count
    return averaged


def _seconds(one: Struck) -> float:
    return int(one.after.shape[1]) / one.rate_hz


def _lasts(one: Struck, band: tuple[float, float]) -> float:
    """How long it is heard in the band [s]: until its energy is that of the noise."""
    if one.before.shape[1] < _LEAST_BEFORE:
        return _seconds(one)
    edges = (band[0], min(band[1], 0.45 * one.rate_hz))
    only = butter(2, edges, "bandpass", fs=one.rate_hz, output="sos")
    before, after = sosfiltfilt(only, one.before, axis=1), sosfiltfilt(only, one.after, axis=1)
    noise = before.var(axis=1)
    block = max(8, after.shape[1] // 200)
    count = after.shape[1] // block
    parts = after[:, : count * block].reshape(len(noise), count, block)
    energy = (parts.var(axis=2) / np.maximum(noise, 1e-300)[:, None]).mean(axis=0)
    heard = np.flatnonzero(energy > _ENDED)
    return (int(heard[-1]) + 1) * block / one.rate_hz if len(heard) else _seconds(one)


def _transformed(values: Real, rate: float, lines: Real) -> Complex:
    """Integral of y exp(-i w t) by the trapezoid rule, a chirp z-transform; (n_freq, n_channel)."""
    weights = np.full(values.shape[1], 1 / rate)
    weights[0] /= 2
    step, first = lines[1] - lines[0], lines[0]
    ratio, begin = np.exp(-2j * np.pi * np.array([step, -first]) / rate)
    found: Complex = czt(values * weights, len(lines), ratio, begin, axis=1).T
    return found


def _noise(before: Real, rate: float, lines: Real) -> Real:
    """Power of the noise per Hz in the band [.. s per s of record]; (n_channel,)."""
    if before.shape[1] < _LEAST_BEFORE:
        raise InputError(
            f"only {before.shape[1]} samples lie before the impact: begin to record earlier, so "
            "that the noise is known"
        )
    spectrum = np.abs(np.fft.rfft(before - before.mean(axis=1, keepdims=True), axis=1)) ** 2
    freq = np.fft.rfftfreq(before.shape[1], 1 / rate)
    inside = (freq >= lines[0]) & (freq <= lines[-1])
    chosen = spectrum[:, inside] if inside.sum() > 2 else spectrum[:, 1:]
    found: Real = chosen.mean(axis=1) / before.shape[1] / rate
    return found
