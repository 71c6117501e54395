r"""Force of the hammer hits in time, from what a campaign tells about it.

A hit is a half sine of its peak A and a duration T,

    f(t) = A sin(pi t / T),   F(w) = A T / 2 [sinc(f T - 1/2) + sinc(f T + 1/2)] exp(-i pi f T).

Records hold the force. T is the duration whose |F| explains the mean spectrum of the hits best; the
median of all tests counts. A = pi P / (2 T) follows from the momentum P, which is what a joint
below the hammer's band feels; a recorder samples too slowly for the peak itself.

FRFs hold no force, but their variance does; A is then the level of the test. With a noise of the
density S in the accelerations it is S / (n |F|^2) for n hits, and it rises where the force fades
(Bendat and Piersol 2010, ch. 9). T is the duration whose spectrum explains the shape of the
variance along frequency best, beside a noise that is a power of frequency.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtri

from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.level_check import group_visits
from identification.words import Campaign, Complex, HitEstimate, Real, group_by_key


def compute_pulse_force(time_s: Real, duration_s: Real | float) -> Real:
    """Return the force of half sines of unit peak, in the shape of both arguments together."""
    inside = (time_s >= 0) & (time_s <= duration_s)
    return np.where(inside, np.sin(np.pi * time_s / duration_s), 0.0)


def compute_pulse_spectrum(freq_hz: Real, duration_s: float) -> Complex:
    """Return the Fourier transform of a half sine of unit peak [N s / N]; (n_freq,)."""
    cycles = freq_hz * duration_s
    size = duration_s / 2 * (np.sinc(cycles - 0.5) + np.sinc(cycles + 0.5))
    return size * np.exp(-1j * np.pi * cycles)


@dataclass(frozen=True, eq=False)
class Pulses:
    """Estimated half sine of each test's hits.

    Args:
        peak: of the root-mean-square hit of each test, signed along the positive axis of its
            reference [N]; (n_test,).
        duration_s: duration of all hits [s].
        relative_momenta: of single hits of each test over their root mean square, the smallest
            first; None without records; n_test.
    """

    peak: Real
    duration_s: float
    relative_momenta: tuple[Real | None, ...]

    def list_sizes(self, test: int, count: int) -> Real:
        """Return equally probable sizes of a test's hits over their root mean square; (count,).

        They have the variance of all hits.

        Args:
            test: its number.
            count: sizes that stand for all.
        """
        shares = (np.arange(count) + 0.5) / count
        momenta = self.relative_momenta[test]
        if momenta is None:
            return np.exp(LEVEL_SETTINGS.hit_scatter * _scale_to_deviation(ndtri(shares), 1.0))
        quantiles = np.quantile(momenta, shares, method="hazen")
        return momenta.mean() + _scale_to_deviation(quantiles, float(momenta.std()))


def _scale_to_deviation(values: Real, deviation: float) -> Real:
    """Return values less their mean, with a given standard deviation."""
    off = values - values.mean()
    return off * (deviation / off.std()) if off.std() > 0 else off


@lru_cache(4)  # each refit of a law asks for the pulses of the same campaign
def estimate_pulses(campaign: Campaign) -> Pulses:
    """Estimate the hits of each test: from records, or from the stated level and the variance.

    Tests at one hammer point in one visit to a level have equal hits: the mean of their records.
    The simulation resolves pulses down to a fifth of the period of the highest line. Shorter ones
    are simulated with that duration and their own momentum. Where the gain of the hammer is
    unknown, the stated level stays the peak.

    Args:
        campaign: tests with records, or with the variance of their FRFs.
    """
    tests = campaign.tests
    signs = np.array([test.condition.reference.sign for test in tests])
    peaks = signs * np.array([test.condition.level_n or 0.0 for test in tests])
    relative: list[Real | None] = [None] * len(tests)
    durations = [_fit_duration(test.hits) for test in tests if test.hits]
    if not durations:
        return Pulses(peaks, _estimate_pulse_duration(campaign), tuple(relative))
    shortest = LEVEL_SETTINGS.durations[0] / float(campaign.freq_hz[-1])
    duration = max(float(np.median(durations)), shortest)
    for recorded in _group_recorded(campaign):
        momenta = [np.array([hit.momentum for hit in hits.kept]) for _, hits in recorded]
        roots = [np.sign(p.sum()) * np.sqrt(np.mean(p**2)) for p in momenta]
        ratios = [np.abs(p / root) for p, root in zip(momenta, roots, strict=True)]
        for number, _ in recorded:
            relative[number] = np.sort(np.concatenate(ratios))
            if tests[number].condition.instrument not in campaign.unknown_gains.hammers:
                peaks[number] = signs[number] * np.pi / (2 * duration) * np.mean(roots)
    return Pulses(peaks, duration, tuple(relative))


def _group_recorded(campaign: Campaign) -> list[list[tuple[int, HitEstimate]]]:
    """Return number and hits of recorded tests, by hammer point and visit to a level."""
    number_of = {id(test): number for number, test in enumerate(campaign.tests)}
    groups = group_by_key(
        ((visit, test.condition.reference), (number_of[id(test)], test.hits))
        for visit, (_, visited) in enumerate(group_visits(campaign))
        for test in visited.tests
        if test.hits
    )
    return list(groups.values())


def _fit_duration(hits: HitEstimate) -> float:
    """Return the duration of the half sine with the nearest |F|, by least squares [s].

    With blocks of t and a one-sided amplitude density D, |F| = D (t / 2)^(1/2). Lines count up to
    the limit of the anti-aliasing filter.
    """
    densities = hits.densities
    inside = (densities.freq_hz > 0) & (densities.freq_hz <= hits.usable_limit_hz)
    freq_hz, amplitude = densities.freq_hz[inside], densities.force[inside]
    shortest, longest = LEVEL_SETTINGS.recorded_durations
    cycles = np.geomspace(shortest, longest, LEVEL_SETTINGS.recorded_duration_count)
    durations = cycles / freq_hz[-1]

    def explain(duration_s: float) -> float:
        unit = np.abs(compute_pulse_spectrum(freq_hz, duration_s))
        return float((unit @ amplitude) ** 2 / (unit @ unit))

    return float(durations[int(np.argmax([explain(duration) for duration in durations]))])


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
