r"""Whether what coherence calls noise is noise: neighbouring lines of noise do not agree.

Coherence is lost to noise, and to hits of one column that differ: a joint that loosens meanwhile,
friction that sticks at a weak hit, an aim that scatters. The average over hits is as smooth along
frequency as any FRF then. White noise of variance v gives third differences of variance 20 v, a
smooth FRF none (``variance.difference_variance``): over windows of lines and the channels of a test

    r = median over channels of log(mean |difference|^2 / (20 mean v))

is where only noise counts the same at all frequencies, some lower than 0 for few hits and windows
of the transform, and lower where lines agree better than their coherence says. Sharp resonances
raise it. Noise that channels share scatters more from window to window than between channels: the
windows' own scatter above their median says how much is chance. It proves no effect of the machine,
only that coherence says too much noise: whether a gap is left beside what scatters is another
question.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from identification.words import Campaign, Real, Test

_WINDOW = 15  # lines
_USUAL = 0.75  # quantile of r over the band that noise alone has
_AGREE = 0.8  # of the variance: below, lines agree too well
_SURE = 4.0  # standard deviations
_PART, _FEWEST = 0.03, 2  # of the windows
_CHANNELS = 6  # at least, for their median to mean something
_NEAR = 3  # windows that a channel's own ratio is the mean of
_OWN = 0.4  # of a window's standard deviation, that it may then be low by chance


@dataclass(frozen=True, eq=False)
class Unsteady:
    """A test whose lines agree better than their coherence says.

    Args:
        test: its number in the campaign.
        freq_hz: middle of each window [Hz]; (n_window,).
        noise: part of the variance by coherence that scatters like noise, 1 where nothing is seen;
            the median over channels; (n_window,).
        parts: the same of each channel, none less than the median's; (n_window, n_out).
    """

    test: int
    freq_hz: Real
    noise: Real
    parts: Real

    @property
    def band(self) -> tuple[float, float]:
        """From the first to the last frequency where it shows [Hz]."""
        seen = self.freq_hz[self.noise < 1]
        return float(seen[0]), float(seen[-1])


def unsteady(campaign: Campaign) -> tuple[Unsteady, ...]:
    """Tests in which hits of one column met different machines; none without coherence."""
    found = []
    for number, test in enumerate(campaign.tests):
        ratio = _agreement(test)
        if ratio is None:
            continue
        windows, each, spread, deviation = ratio
        usual = min(float(np.quantile(windows, _USUAL)), 0.0)
        low = windows < usual + min(float(np.log(_AGREE)), -_SURE * deviation)
        beside = np.pad(low, 1)
        low &= beside[:-2] | beside[2:]  # one window alone is chance
        if low.sum() < max(_FEWEST, _PART * len(low)):
            continue
        middle = (np.arange(len(windows)) + 0.5) * _WINDOW + 1.5
        freq = np.interp(middle, np.arange(len(campaign.freq_hz)), campaign.freq_hz)
        noise = np.where(low, np.exp(windows - usual), 1.0)
        own = np.exp(np.minimum(each - usual + _OWN * spread, 0.0))
        parts = np.where(low[:, None], np.maximum(own, noise[:, None]), 1.0)
        found.append(Unsteady(number, freq, noise, parts))
    return tuple(found)


def steadied(campaign: Campaign, found: tuple[Unsteady, ...]) -> Campaign:
    """The same with the variance that scatters like noise: what a model's gap must be held to.

    Its remarks say so.
    """
    if not found:
        return campaign
    tests = list(campaign.tests)
    for one in found:
        test = tests[one.test]
        part = [np.interp(campaign.freq_hz, one.freq_hz, own) for own in one.parts.T]
        variance = test.estimate.variance * np.stack(part, axis=1)[:, :, None]
        tests[one.test] = replace(test, estimate=replace(test.estimate, variance=variance))
    low, high = min(one.band[0] for one in found), max(one.band[1] for one in found)
    remark = (
        f"between {low:.0f} and {high:.0f} Hz the lines of {len(found)} of {len(tests)} tests "
        "agree better than their coherence says: hits of one column differ, as with friction, "
        "play, a joint that loosens or an aim that scatters; what scatters alone counts as noise"
    )
    return replace(campaign, tests=tuple(tests), remarks=(*campaign.remarks, remark))


def _agreement(test: Test) -> tuple[Real, Real, float, float] | None:
    """R of each window and channel; None where it cannot be had.

    Returns:
        The median over channels (n_window,), each channel's (n_window, n_out), zero where it has
        none, its scatter between channels, and the standard deviation of the median.
    """
    estimate = test.estimate
    rows = np.flatnonzero(estimate.measured[:, 0])
    values, variance = estimate.frf.values[:, rows, 0], estimate.variance[:, rows, 0]
    count = (len(values) - 3) // _WINDOW
    if estimate.variance_source != "coherence" or count < _FEWEST or len(rows) < _CHANNELS:
        return None
    squares = np.abs(np.diff(values, 3, axis=0)) ** 2 / 20
    near = (variance[:-3] + 9 * variance[1:-2] + 9 * variance[2:-1] + variance[3:]) / 20
    seen, stated = (
        part[: count * _WINDOW].reshape(count, _WINDOW, -1).mean(axis=1) for part in (squares, near)
    )
    known = ((seen > 0) & (stated > 0)).all(axis=0)
    if known.sum() < _CHANNELS:
        return None
    ratios = np.log(seen[:, known] / stated[:, known])
    middle = np.median(ratios, axis=1)
    between = 1.4826 * np.median(np.abs(ratios - middle[:, None]), axis=1)
    spread = float(np.median(between))
    above = middle[middle >= np.median(middle)] - np.median(middle)
    deviation = max(1.2533 * spread / float(np.sqrt(known.sum())), 1.4826 * float(np.median(above)))
    each = np.zeros((count, len(estimate.measured)))
    each[:, rows[known]] = uniform_filter1d(ratios, _NEAR, axis=0, mode="nearest")
    return middle, each, spread, deviation
