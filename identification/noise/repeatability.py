r"""Test of whether the variance by coherence overstates the noise, as when hits differ.

Noise lowers the coherence, but so do differences between the hits of one test: a joint that
loosens meanwhile, friction that sticks at a weak hit, an aim that scatters. The average over such
hits is still a smooth function of frequency. White noise of variance v, in contrast, gives third
differences of variance 20 v; a smooth FRF hardly contributes (``variance.difference_variance``).
The statistic compares both variances in windows of lines,

    r = median over channels of log(mean |difference|^2 / (20 mean v)),

with v the variance by coherence. If there is noise alone, r is the same at all frequencies, and
somewhat below 0 for few hits and for windows in time. It is lower in windows whose lines agree
better than the coherence lets expect. Sharp resonances raise it. Noise that channels share scatters
more from window to window than between channels. The scatter of the windows above their median
therefore bounds the standard deviation of r from below.

The test finds no effect of the machine. It shows only that the coherence overstates the noise;
whether a model's gap exceeds the remaining noise is another question.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from identification.words import Campaign, Real, Test

_LINES_PER_WINDOW = 15  # lines over which squares are averaged
_NOISE_QUANTILE = 0.75  # quantile of r over the band that stands for noise alone
_MAX_VARIANCE_RATIO = 0.8  # noise over the variance by coherence, below which it is overstated
_MIN_DEVIATIONS = 4.0  # standard deviations of r by which a window must be low
_MIN_LOW_SHARE, _MIN_LOW_WINDOWS = 0.03, 2  # share and number of windows that must be low
_MIN_CHANNELS = 6  # channels for a meaningful median
_SMOOTHED_WINDOWS = 3  # windows over which the ratio of a single channel is averaged
# Chance of a channel's averaged ratio to be low, in standard deviations of a single window.
_CHANNEL_DEVIATIONS = 0.4
_MAD_TO_SD = 1.4826  # standard deviation over median absolute deviation, normal distribution
_MEDIAN_TO_MEAN_SD = 1.2533  # standard error of a median over that of a mean, sqrt(pi / 2)


@dataclass(frozen=True, eq=False)
class OverstatedNoise:
    """Test whose variance by coherence overstates the noise.

    Args:
        test: index of the test in the campaign.
        freq_hz: middle of each window [Hz]; (n_window,).
        noise_share: noise over the variance by coherence, the median over channels; 1 in windows
            that are not low; (n_window,).
        channel_shares: noise over the variance by coherence of each channel, at least
            ``noise_share``; (n_window, n_out).
    """

    test: int
    freq_hz: Real
    noise_share: Real
    channel_shares: Real

    @property
    def band(self) -> tuple[float, float]:
        """First and last frequency with overstated noise [Hz]."""
        low = self.freq_hz[self.noise_share < 1]
        return float(low[0]), float(low[-1])


def find_overstated_noise(campaign: Campaign) -> tuple[OverstatedNoise, ...]:
    """Find the tests whose variance by coherence overstates the noise.

    Tests without coherence are not examined.
    """
    overstated = []
    for number, test in enumerate(campaign.tests):
        ratios = _log_ratios(test)
        if ratios is None:
            continue
        windows, channels, spread, deviation = ratios
        usual = min(float(np.quantile(windows, _NOISE_QUANTILE)), 0.0)
        drop = min(float(np.log(_MAX_VARIANCE_RATIO)), -_MIN_DEVIATIONS * deviation)
        low = windows < usual + drop
        neighbours = np.pad(low, 1)
        low &= neighbours[:-2] | neighbours[2:]  # a single low window may be chance
        if low.sum() < max(_MIN_LOW_WINDOWS, _MIN_LOW_SHARE * len(low)):
            continue
        middle = (np.arange(len(windows)) + 0.5) * _LINES_PER_WINDOW + 1.5
        freq = np.interp(middle, np.arange(len(campaign.freq_hz)), campaign.freq_hz)
        share = np.where(low, np.exp(windows - usual), 1.0)
        of_channels = np.exp(np.minimum(channels - usual + _CHANNEL_DEVIATIONS * spread, 0.0))
        shares = np.where(low[:, None], np.maximum(of_channels, share[:, None]), 1.0)
        overstated.append(OverstatedNoise(number, freq, share, shares))
    return tuple(overstated)


def remove_overstated_noise(
    campaign: Campaign, overstated: tuple[OverstatedNoise, ...]
) -> Campaign:
    """Reduce the variance by coherence to its noise, with which a model's gap is compared.

    Args:
        overstated: result of ``find_overstated_noise``.

    Returns:
        The campaign with reduced variances and a remark; unchanged if nothing is overstated.
    """
    if not overstated:
        return campaign
    tests = list(campaign.tests)
    for noise in overstated:
        test = tests[noise.test]
        shares = [
            np.interp(campaign.freq_hz, noise.freq_hz, share) for share in noise.channel_shares.T
        ]
        variance = test.estimate.variance * np.stack(shares, axis=1)[:, :, None]
        tests[noise.test] = replace(test, estimate=replace(test.estimate, variance=variance))
    low, high = (
        min(noise.band[0] for noise in overstated),
        max(noise.band[1] for noise in overstated),
    )
    remark = (
        f"between {low:.0f} and {high:.0f} Hz the coherence of {len(overstated)} of {len(tests)} "
        "tests overstates the noise: the hits of a test differ, as with friction, play, a joint "
        "that loosens or an aim that scatters; only scatter from line to line counts as noise"
    )
    return replace(campaign, tests=tuple(tests), remarks=(*campaign.remarks, remark))


def _log_ratios(test: Test) -> tuple[Real, Real, float, float] | None:
    """Return the logarithms of the variance ratio in each window; None if they are unavailable.

    Returns:
        The median ``r`` over channels (n_window,); the ratio of each channel, averaged over three
        windows and zero for channels without one (n_window, n_out); its scatter between channels;
        and the standard deviation of ``r``.
    """
    estimate = test.estimate
    rows = np.flatnonzero(estimate.measured[:, 0])
    values, variance = estimate.frf.values[:, rows, 0], estimate.variance[:, rows, 0]
    count = (len(values) - 3) // _LINES_PER_WINDOW
    has_coherence = estimate.variance_source == "coherence"
    if not has_coherence or count < _MIN_LOW_WINDOWS or len(rows) < _MIN_CHANNELS:
        return None
    squares = np.abs(np.diff(values, 3, axis=0)) ** 2 / 20
    expected = (variance[:-3] + 9 * variance[1:-2] + 9 * variance[2:-1] + variance[3:]) / 20
    scatter, by_coherence = (
        part[: count * _LINES_PER_WINDOW].reshape(count, _LINES_PER_WINDOW, -1).mean(axis=1)
        for part in (squares, expected)
    )
    known = ((scatter > 0) & (by_coherence > 0)).all(axis=0)
    if known.sum() < _MIN_CHANNELS:
        return None
    ratios = np.log(scatter[:, known] / by_coherence[:, known])
    middle = np.median(ratios, axis=1)
    between = _MAD_TO_SD * np.median(np.abs(ratios - middle[:, None]), axis=1)
    spread = float(np.median(between))
    above = middle[middle >= np.median(middle)] - np.median(middle)
    deviation = max(
        _MEDIAN_TO_MEAN_SD * spread / float(np.sqrt(known.sum())),
        _MAD_TO_SD * float(np.median(above)),
    )
    channels = np.zeros((count, len(estimate.measured)))
    channels[:, rows[known]] = uniform_filter1d(ratios, _SMOOTHED_WINDOWS, axis=0, mode="nearest")
    return middle, channels, spread, deviation
