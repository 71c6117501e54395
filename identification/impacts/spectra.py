"""Spectra of impacts whose force was not measured.

After the impact a structure decays freely, as a sum of exponentials A exp(lambda t), whose spectrum

    Y(f) = integral_0^T y(t) exp(-i 2 pi f t) dt = sum A / (i 2 pi f - lambda) + ..

has the shapes of its modes in the residues A = phi gamma, with one factor gamma for each impact and
mode (eq. 10 with an unknown force). Ratios of channels need no more. The noise of a frequency line
is that of the record before the impact, for an equal length of time. Motion below the band, as of
ropes, decays slowly and holds no information in the band: the length is that of the response in the
band.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.impacts.common_clock import SynchronisedImpact
from identification.words import Complex, Dof, InputError, Real

_MIN_SAMPLES_BEFORE = 32  # samples before the impact from which the noise can be estimated
_MIN_SAMPLES_AFTER = 32  # samples after the impact, for a filter of fourth order
_MIN_BAND_SHARE = 1e-6  # of its end, at which a band may begin: below, the filter has no digits
_DECAYED_ENERGY = 1.5  # energy over that before the impact, below which the response has decayed


@dataclass(frozen=True, eq=False)
class ImpactSpectra:
    """Spectra of several impacts at common channels.

    Args:
        sources: files; n_impact.
        dofs: degrees of freedom of the channels; n_channel.
        freq_hz: frequency lines, evenly spaced [Hz]; (n_freq,).
        values: Y [m/s2 s]; (n_freq, n_channel, n_impact).
        variance: E|error|^2 of their noise; (n_channel, n_impact).
    """

    sources: tuple[str, ...]
    dofs: tuple[Dof, ...]
    freq_hz: Real
    values: Complex
    variance: Real


def impact_spectra(
    impacts: Sequence[SynchronisedImpact], band: tuple[float, float], *, finer: int = 1
) -> ImpactSpectra:
    """Compute spectra on frequency lines that all impacts share.

    The records are cut where the slowest response has decayed, so that the lines are no closer than
    the information in them. All are cut at one length.

    Args:
        impacts: impacts on common clocks, with equal channels.
        band: lowest and highest line [Hz].
        finer: number of lines per independent line, for plots. Values in between are exact, since
            the decay is complete, and hold no new information.

    Raises:
        InputError: impacts with different channels, a record too short before the impact, or a band
            above half the sampling rate.
    """
    first = impacts[0]
    for impact in impacts[1:]:
        if set(impact.dofs) != set(first.dofs):
            differing = sorted(map(str, set(impact.dofs) ^ set(first.dofs)))
            raise InputError(
                f"{impact.source} and {first.source} differ in {', '.join(differing)}. All impacts "
                "must be read by the same channels."
            )
    lowest_rate = min(impact.rate_hz for impact in impacts)
    if band[1] > lowest_rate / 2:
        raise InputError(
            f"the band ends at {band[1]:g} Hz, above half of the {lowest_rate:.4g} samples a "
            "second. Lower its end."
        )
    shortest = min(impacts, key=lambda impact: int(impact.after.shape[1]))
    if shortest.after.shape[1] < _MIN_SAMPLES_AFTER:
        raise InputError(
            f"{shortest.source}: only {shortest.after.shape[1]} samples lie after the impact: "
            "record for longer"
        )
    if band[0] < _MIN_BAND_SHARE * band[1]:
        raise InputError(
            f"the band begins at {band[0]:g} Hz, too near to zero for its end at {band[1]:g} Hz. "
            "Raise its start."
        )
    length = min(
        max(_audible_duration(impact, band) for impact in impacts),
        *(_duration_after(impact) for impact in impacts),
    )
    lines_per_hz = finer * length
    freq_hz = (
        np.arange(np.ceil(band[0] * lines_per_hz), np.floor(band[1] * lines_per_hz) + 1)
        / lines_per_hz
    )
    if len(freq_hz) < 8 * finer:
        raise InputError(
            f"the impacts last {length:.3g} s, which gives {len(freq_hz) // finer} frequency lines "
            f"between {band[0]:g} and {band[1]:g} Hz. Record for longer, or widen the band."
        )
    values = np.zeros((len(freq_hz), len(first.dofs), len(impacts)), complex)
    variance = np.zeros((len(first.dofs), len(impacts)))
    for k, impact in enumerate(impacts):
        order = [impact.dofs.index(dof) for dof in first.dofs]
        count = int(length * impact.rate_hz)
        after = impact.after[order, :count]
        level = impact.before[order].mean(axis=1, keepdims=True) if impact.before.size else 0.0
        values[:, :, k] = _fourier_integral(after - level, impact.rate_hz, freq_hz)
        variance[:, k] = _noise_density(impact.before[order], impact.rate_hz, freq_hz) * length
    return ImpactSpectra(
        tuple(impact.source for impact in impacts), first.dofs, freq_hz, values, variance
    )


def sliding_average(values: Real, freq_hz: Real, width_hz: float) -> Real:
    """Return the sliding average over a width in Hz; at the ends, over the lines that there are.

    Args:
        values: amplitudes; (n_freq, ...).
        freq_hz: evenly spaced lines [Hz].
        width_hz: width of the average; below the line spacing nothing changes.
    """
    spacing = float(freq_hz[1] - freq_hz[0])
    half = int(min(width_hz / spacing / 2, len(values)))
    total = np.cumsum(np.concatenate([np.zeros((1, *values.shape[1:])), values]), axis=0)
    place = np.arange(len(values))
    low, high = np.maximum(place - half, 0), np.minimum(place + half + 1, len(values))
    count = (high - low).reshape(-1, *(1,) * (values.ndim - 1))
    return (total[high] - total[low]) / count


def _duration_after(impact: SynchronisedImpact) -> float:
    """Return the length of a record from the impact on [s]."""
    return int(impact.after.shape[1]) / impact.rate_hz


def _audible_duration(impact: SynchronisedImpact, band: tuple[float, float]) -> float:
    """Return how long an impact exceeds the noise in the band [s]."""
    if impact.before.shape[1] < _MIN_SAMPLES_BEFORE:
        return _duration_after(impact)
    edges = (band[0], min(band[1], 0.45 * impact.rate_hz))
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415  # slow to load

    bandpass = butter(2, edges, "bandpass", fs=impact.rate_hz, output="sos")
    before, after = (
        sosfiltfilt(bandpass, impact.before, axis=1),
        sosfiltfilt(bandpass, impact.after, axis=1),
    )
    noise = before.var(axis=1)
    block = max(8, after.shape[1] // 200)
    count = after.shape[1] // block
    blocks = after[:, : count * block].reshape(len(noise), count, block)
    energy = (blocks.var(axis=2) / np.maximum(noise, 1e-300)[:, None]).mean(axis=0)
    audible = np.flatnonzero(energy > _DECAYED_ENERGY)
    return (
        (int(audible[-1]) + 1) * block / impact.rate_hz if len(audible) else _duration_after(impact)
    )


def _fourier_integral(values: Real, rate: float, lines: Real) -> Complex:
    """Compute the integral of y exp(-i w t) by the trapezoid rule, as a chirp z-transform.

    Returns:
        (n_freq, n_channel).
    """
    weights = np.full(values.shape[1], 1 / rate)
    weights[0] /= 2
    step, first = lines[1] - lines[0], lines[0]
    ratio, origin = np.exp(-2j * np.pi * np.array([step, -first]) / rate)
    from scipy.signal import czt  # noqa: PLC0415  # slow to load

    return czt(values * weights, len(lines), ratio, origin, axis=1).T


def _noise_density(before: Real, rate: float, lines: Real) -> Real:
    """Return the power of the noise per Hz in the band [.. s per s of record]; (n_channel,)."""
    if before.shape[1] < _MIN_SAMPLES_BEFORE:
        raise InputError(
            f"only {before.shape[1]} samples lie before the impact: start the record earlier, so "
            "that the noise can be estimated"
        )
    spectrum = np.abs(np.fft.rfft(before - before.mean(axis=1, keepdims=True), axis=1)) ** 2
    freq = np.fft.rfftfreq(before.shape[1], 1 / rate)
    in_band = (freq >= lines[0]) & (freq <= lines[-1])
    powers = spectrum[:, in_band] if in_band.sum() > 2 else spectrum[:, 1:]
    return powers.mean(axis=1) / before.shape[1] / rate
