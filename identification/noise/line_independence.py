r"""Test of whether the noise of neighbouring frequency lines is independent.

The statistic compares third differences over steps of one line and of two lines,

    r = median of log(mean |difference over one|^2 / mean |difference over two|^2),

where the means are over windows of 15 lines of a channel. White noise gives both differences the
same variance, so that r = 0. A window in time, or an average along frequency, correlates
neighbouring lines: positively, or negatively if the window is highest in the middle of the block.
An exponential window that falls to exp(-4) scales the variance over one line by 0.62 and over two
lines by 0.88; a Hann window by 2.1 and 0.75.

The FRF itself is not a polynomial, which raises the differences over two lines first. The median
is therefore over the tenth of all windows with the most noise relative to the FRF, and over at
least 200 of them. If the lines are independent, parts that they share are not noise.
"""

import numpy as np

from identification.words import Campaign, Complex, FrfEstimate, Real

_WINDOW_LINES = 15  # lines of a window over which squares are averaged
_NOISIEST_SHARE = 0.1  # of all windows: those with the most noise relative to the FRF
_MIN_WINDOWS = 200  # windows of channels: with so many, r scatters by 0.05
# Largest |r| of independent lines. An exponential window that falls to exp(-1.5) over a block has
# this r; lines three to six apart share 1.3 % of its noise. Sharp modes raise r to 0.15.
_MAX_LOG_RATIO = 0.2
_MAX_LOG_RATIO_OF_TEST = 0.35  # for a single test, whose r scatters more
# Block length over time constant of a known exponential window: at 0.8 lines share 0.4 % of noise.
_MAX_WINDOW_DECAY = 0.8


def lines_are_independent(campaign: Campaign) -> bool:
    """Return whether the noise of neighbouring lines is independent.

    The answer is no if there are too few lines for a decision.
    """
    estimates = [test.estimate for test in campaign.tests]
    if any(_window_decay(estimate) > _MAX_WINDOW_DECAY for estimate in estimates):
        return False
    windows = [_window_means(estimate) for estimate in estimates]
    whole = _log_ratio(np.concatenate(windows, axis=1))
    # A window in time in one test must not be averaged out by the tests without.
    of_tests = (ratio for means in windows if (ratio := _log_ratio(means)) is not None)
    return (
        whole is not None
        and abs(whole) < _MAX_LOG_RATIO
        and all(abs(ratio) < _MAX_LOG_RATIO_OF_TEST for ratio in of_tests)
    )


def _window_decay(estimate: FrfEstimate) -> float:
    """Return the block length over the time constant of the exponential window, 0 without one."""
    freq_hz = estimate.frf.freq_hz
    if not estimate.window_tau or len(freq_hz) < 2:
        return 0.0
    return float(1 / (np.diff(freq_hz).min() * estimate.window_tau))


def _log_ratio(means: Real) -> float | None:
    """Return the statistic r, or None if there are too few windows.

    Args:
        means: means from ``_window_means``; (4, n_window).
    """
    power, variance, over_one, over_two = means[:, (means > 0).all(axis=0)]
    if power.size < _MIN_WINDOWS:
        return None
    noisy = np.argsort(power / variance)[: max(_MIN_WINDOWS, round(_NOISIEST_SHARE * power.size))]
    return float(np.median(np.log(over_one[noisy] / over_two[noisy])))


def _window_means(estimate: FrfEstimate) -> Real:
    """Return means over windows of lines; (4, n_window).

    The rows are |H|^2, the variance, and squared third differences over one and two lines.
    """
    values = estimate.frf.values[:, estimate.measured]
    count = max(len(values) - 6, 0) // _WINDOW_LINES
    over_one = np.diff(values, 3, axis=0)[1:]
    power, one_line, two_lines = (
        np.abs(part) ** 2 for part in (values[3:], over_one, _differences_over_two(values))
    )
    squares = power, estimate.variance[3:, estimate.measured], one_line, two_lines
    shape = count, _WINDOW_LINES, values.shape[1]
    windows = [part[: count * _WINDOW_LINES].reshape(shape) for part in squares]
    return np.stack([part.mean(axis=1).ravel() for part in windows])


def _differences_over_two(values: Complex) -> Complex:
    """Return third differences over steps of two lines."""
    count = max(len(values) - 6, 0)
    first, second, third, fourth = (values[2 * k :][:count] for k in range(4))
    return fourth - 3 * third + 3 * second - first
