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
from scipy.stats import norm

from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.level_check import group_visits
from identification.words import Campaign, Complex, HitEstimate, Input, Real, Test


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


@dataclass(frozen=True, eq=False)
class Pulses:
    """Hits of all tests.

    Args:
        peak: of the mean hit of each test, signed as the reference [N]; (n_test,).
        duration_s: of all [s].
        momenta: of single hits of each test over their root mean square, the smallest first; None
            without records; n_test.
    """

    peak: Real
    duration_s: float
    momenta: tuple[Real | None, ...]

    def list_sizes(self, test: int, count: int) -> Real:
        """Return equally probable sizes of the hits of a test over the mean hit; (count,).

        Args:
            test: its number.
            count: sizes that stand for all.
        """
        shares = (np.arange(count) + 0.5) / count
        momenta = self.momenta[test]
        if momenta is None:
            normal = norm.ppf(shares)
            scatter = LEVEL_SETTINGS.hit_scatter
            usual: Real = np.exp(scatter * normal / np.sqrt(np.mean(normal**2)))
            return usual
        sizes: Real = np.quantile(momenta, shares, method="hazen")
        return sizes


def estimate_pulses(campaign: Campaign) -> Pulses:
    """Estimate the hits of each test: from records, or from the stated level and the variance.

    Tests of one visit to a level have equal hits at each hammer point: the mean of their records.

    Args:
        campaign: tests with records, or with the variance of their FRFs.
    """
    conditions = [test.condition for test in campaign.tests]
    peaks = np.array([float(c.level_n or 0.0) * c.reference.sign for c in conditions])
    momenta: list[Real | None] = [None] * len(peaks)
    spectra = {
        c: _ForceSpectrum.of_hits(t.hits)
        for c, t in zip(conditions, campaign.tests, strict=True)
        if t.hits
    }
    if not spectra:
        return Pulses(peaks, _estimate_pulse_duration(campaign), tuple(momenta))
    duration = float(np.median([spectrum.fit_duration() for spectrum in spectra.values()]))
    for tests in _group_recorded(campaign):
        peak = np.mean([spectra[test.condition].fit_peak(duration) for test in tests])
        hits = [_list_momenta(test.hits) for test in tests if test.hits]
        for test in tests:
            place = conditions.index(test.condition)
            peaks[place] = np.sign(peaks[place]) * peak
            momenta[place] = np.sort(np.concatenate(hits))
    return Pulses(peaks, duration, tuple(momenta))


def _group_recorded(campaign: Campaign) -> list[list[Test]]:
    """Return the tests with records of each hammer point in each visit to a level."""
    groups: dict[tuple[int, Input], list[Test]] = {}
    for visit, (_, visited) in enumerate(group_visits(campaign)):
        for test in visited.tests:
            if test.hits:
                groups.setdefault((visit, test.condition.reference), []).append(test)
    return list(groups.values())


def _list_momenta(hits: HitEstimate) -> Real:
    """Return the momenta of the kept hits over their root mean square; (n_hit,)."""
    momenta = np.abs([hit.momentum for hit in hits.kept])
    relative: Real = momenta / np.sqrt(np.mean(momenta**2))
    return relative


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
