r"""Force of a hammer hit in time, from what a campaign of FRFs tells about it.

A hit is a half sine of its peak A (the level of the test) and a duration T,

    f(t) = A sin(pi t / T),   F(w) = A T / 2 [sinc(f T - 1/2) + sinc(f T + 1/2)] exp(-i pi f T).

FRFs hold no force, but their variance does: with a noise of the density S in the accelerations it
is S / (n |F|^2) for n hits, and it rises where the force fades (Bendat and Piersol 2010, ch. 9). T
is the duration whose spectrum explains the shape of the variance along frequency best, beside a
noise that is a power of frequency.
"""

import numpy as np

from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Campaign, Complex, Real


def compute_pulse_force(time_s: Real, duration_s: Real | float) -> Real:
    """Return the force of half sines of unit peak, in the shape of both arguments together."""
    inside = (time_s >= 0) & (time_s <= duration_s)
    force: Real = np.where(inside, np.sin(np.pi * time_s / duration_s), 0.0)
    return force


def compute_pulse_spectrum(freq_hz: Real, duration_s: float) -> Complex:
    """Return the Fourier transform of a half sine of unit peak [N s / N]; (n_freq,)."""
    cycles = freq_hz * duration_s
    size = duration_s / 2 * (np.sinc(cycles - 0.5) + np.sinc(cycles + 0.5))
    spectrum: Complex = size * np.exp(-1j * np.pi * cycles)
    return spectrum


def estimate_pulse_duration(campaign: Campaign) -> float:
    """Estimate the duration of the hits from the variance of the FRFs [s].

    Each test gives one estimate, by least squares of the median logarithm of the variance over its
    channels; the median of all tests counts. Where no variance shows that the force fades, the hits
    are taken to last as long as those that just excite the band.

    Args:
        campaign: tests with the variance of their FRFs.
    """
    freq = campaign.freq_hz
    shortest, longest = LEVEL_SETTINGS.durations
    durations = np.linspace(shortest, longest, LEVEL_SETTINGS.duration_count) / freq[-1]
    fades = -2 * np.log(np.abs([compute_pulse_spectrum(freq, duration) for duration in durations]))
    noise = np.stack([np.ones_like(freq), np.log(freq)], axis=1)
    basis, _ = np.linalg.qr(noise)
    best = []
    for test in campaign.tests:
        variance = test.estimate.variance[:, test.estimate.measured]
        positive = np.where(variance > 0, variance, np.nan)
        if not np.isfinite(positive).any(axis=1).all():
            continue
        rise = np.nanmedian(np.log(positive), axis=1)
        off = (rise - fades).T
        off -= basis @ (basis.T @ off)
        chosen = int((off**2).sum(axis=0).argmin())
        if chosen > 0:  # the shortest one fades nowhere in the band
            best.append(durations[chosen])
    return float(np.median(best)) if best else LEVEL_SETTINGS.usual_duration / float(freq[-1])
