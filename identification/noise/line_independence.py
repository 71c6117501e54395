r"""Whether neighbouring lines have noise of their own: what they share is no noise then.

White noise gives third differences over steps of one line and of two the same variance. A window
in time, or an average along frequency, makes neighbours alike, or opposite where it is highest in
the middle of the block: an exponential window that falls to exp(-4) leaves of those over one line
0.62 of the noise's, of those over two 0.88; a Hann window 2.1 and 0.75. An FRF itself is no
polynomial either, which those over two show first: so what counts is the tenth of all windows of
lines and channels, but no fewer than 200, in which the noise is largest beside the FRF,

    r = median of log(mean |difference over one|^2 / mean |difference over two|^2),

0 of white noise.
"""

import numpy as np

from identification.words import Campaign, Complex, FrfEstimate, Real

_WINDOW = 15  # lines
_NOISIEST = 0.1  # of them
# Of r, which an exponential window has that falls to exp(-1.5) over a block: lines that are three
# to six apart share 1.3 % of its noise. Sharp modes bring it to 0.15.
_ALIKE = 0.2
_ALONE = 0.35  # the same of a single test
_FALLS = 0.8  # time constants of a window that is known: 0.4 % are shared
_FEWEST = 200  # windows of channels: r of as many scatters by 0.05


def independent(campaign: Campaign) -> bool:
    """Whether the noise of neighbouring lines is independent; no where too few lines tell."""
    estimates = [test.estimate for test in campaign.tests]
    if any(_falls(one) > _FALLS for one in estimates):
        return False
    each = [_cells(one) for one in estimates]
    whole = _ratio(np.concatenate(each, axis=1))
    # Of a single test r scatters more, and a window in it must not hide among the others.
    apart = (ratio for cells in each if (ratio := _ratio(cells)) is not None)
    return whole is not None and abs(whole) < _ALIKE and all(abs(r) < _ALONE for r in apart)


def _falls(estimate: FrfEstimate) -> float:
    """By how many time constants the window falls over a block that the data are known to carry."""
    freq_hz = estimate.frf.freq_hz
    if not estimate.window_tau or len(freq_hz) < 2:
        return 0.0
    return float(1 / ((freq_hz[1] - freq_hz[0]) * estimate.window_tau))


def _ratio(cells: Real) -> float | None:
    """The logarithm r; None of too few windows."""
    power, variance, one, two = cells[:, (cells > 0).all(axis=0)]
    if power.size < _FEWEST:
        return None
    noisy = np.argsort(power / variance)[: max(_FEWEST, round(_NOISIEST * power.size))]
    return float(np.median(np.log(one[noisy] / two[noisy])))


def _cells(estimate: FrfEstimate) -> Real:
    """Means of |H|^2, of the variance, of squared third differences over 1 and 2; (4, n_cell)."""
    values = estimate.frf.values[:, estimate.measured]
    count = max(len(values) - 6, 0) // _WINDOW
    over_one = np.diff(values, 3, axis=0)[1:]
    power, one, two = (np.abs(part) ** 2 for part in (values[3:], over_one, _over_two(values)))
    squares = power, estimate.variance[3:, estimate.measured], one, two
    parts = [part[: count * _WINDOW].reshape(count, _WINDOW, values.shape[1]) for part in squares]
    return np.stack([part.mean(axis=1).ravel() for part in parts])


def _over_two(values: Complex) -> Complex:
    """Third differences over two lines."""
    count = max(len(values) - 6, 0)
    first, second, third, fourth = (values[2 * k :][:count] for k in range(4))
    found: Complex = fourth - 3 * third + 3 * second - first
    return found
