r"""Force of the hammer hits in time, from what a campaign tells about it.

A hit is a half sine of its peak A (the level of the test) and a duration T,

    f(t) = A sin(pi t / T),   F(w) = A T / 2 [sinc(f T - 1/2) + sinc(f T + 1/2)] exp(-i pi f T).

Records hold the force. T is the duration whose |F| explains the mean spectrum of the hits best, and
A the peak of a half sine with their momentum: a recorder samples too slowly for the peak itself.

FRFs hold no force, but their variance does: with a noise of the density S in the accelerations it
is S / (n |F|^2) for n hits, and it rises where the force fades (Bendat and Piersol 2010, ch. 9). T
is the duration whose spectrum explains the shape of the variance along frequency best, beside a
noise that is a power of frequency.
"""

from dataclasses import dataclass

import numpy as np

from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Campaign, Complex, HitEstimate, Real


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


def estimate_pulses(campaign: Campaign) -> tuple[Real, float]:
    """Estimate the peak of the hits of each test [N], and the duration of all [s].

    Tests at equal hammer points and levels have equal hits: the mean over those with records.

    Args:
        campaign: tests with records, or with the variance of their FRFs.

    Returns:
        Peaks (n_test,), signed as the references, and the duration.
    """
    conditions = [test.condition for test in campaign.tests]
    stated = np.array([float(c.level_n or 0.0) * c.reference.sign for c in conditions])
    recorded = [
        None if test.hits is None else _ForceSpectrum.of_hits(test.hits) for test in campaign.tests
    ]
    durations = [spectrum.fit_duration() for spectrum in recorded if spectrum is not None]
    if not durations:
        return stated, _estimate_pulse_duration(campaign)
    duration = float(np.median(durations))
    alike: dict[tuple[str, float], list[float]] = {}
    for condition, level, spectrum in zip(conditions, stated, recorded, strict=True):
        if spectrum is not None:
            peak = np.sign(level) * spectrum.fit_peak(duration)
            alike.setdefault((str(condition.reference.positive), level), []).append(peak)
    return np.array(
        [
            np.mean(alike.get((str(c.reference.positive), level), [level]))
            for c, level in zip(conditions, stated, strict=True)
        ]
    ), duration


@dataclass(frozen=True, eq=False)
class _ForceSpectrum:
    """Mean force spectrum of the kept hits of a test.

    Args:
        freq_hz: lines up to the limit of the anti-aliasing filter; (n_freq,).
        size: |F| [N s]; (n_freq,).
    """

    freq_hz: Real
    size: Real

    @classmethod
    def of_hits(cls, hits: HitEstimate) -> "_ForceSpectrum":
        """Return |F| = D (t / 2)^(1/2) of the one-sided amplitude density D of blocks of t."""
        densities = hits.densities
        inside = (densities.freq_hz > 0) & (densities.freq_hz <= hits.usable_limit_hz)
        size = densities.force[inside] * np.sqrt(hits.block_s / 2)
        return cls(densities.freq_hz[inside], size)

    def fit_duration(self) -> float:
        """Return the duration of the half sine with the nearest |F|, by least squares [s]."""
        shortest, longest = LEVEL_SETTINGS.recorded_durations
        cycles = np.geomspace(shortest, longest, LEVEL_SETTINGS.recorded_duration_count)
        durations = cycles / self.freq_hz[-1]
        explained = [self._project(duration) for duration in durations]
        return float(durations[int(np.argmax(explained))])

    def fit_peak(self, duration_s: float) -> float:
        """Return the peak of half sines of a duration with the nearest |F| [N]."""
        unit = np.abs(compute_pulse_spectrum(self.freq_hz, duration_s))
        return float(unit @ self.size / (unit @ unit))

    def _project(self, duration_s: float) -> float:
        """Return the part of |F| that half sines of a duration explain."""
        unit = np.abs(compute_pulse_spectrum(self.freq_hz, duration_s))
        return float((unit @ self.size) ** 2 / (unit @ unit))


def _estimate_pulse_duration(campaign: Campaign) -> float:
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
