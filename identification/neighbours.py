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
_FEWEST = 200  # windows of channels: r of as many scatters by 0.05


def independent(campaign: Campaign) -> bool:
    """Whether the noise of neighbouring lines is independent; no where too few lines tell."""
    cells = np.concatenate([_cells(test.estimate) for test in campaign.tests], axis=1)
    power, variance, one, two = cells[:, (cells > 0).all(axis=0)]
    if power.size < _FEWEST:
        return False
    noisy = np.argsort(power / variance)[: max(_FEWEST, round(_NOISIEST * power.size))]
    return bool(abs(np.median(np.log(one[noisy] / two[noisy]))) < _ALIKE)


def _cells(estimate: FrfEstimate) -> Real:
    """Means of |H|^2, of the variance, of squared third differences over 1 and 2; (4, n_cell)."""
    values = estimate.frf.values[:, estimate.measured]
    count = max(len(values) - 6, 0) // _WINDOW
    one, two = _differences(values, 1)[1:], _differences(values, 2)
    squares = [np.abs(part) ** 2 for part in (values[3:], one, two)]
    squares.insert(1, estimate.variance[3:, estimate.measured])
    parts = [part[: count * _WINDOW].reshape(count, _WINDOW, values.shape[1]) for part in squares]
    return np.stack([part.mean(axis=1).ravel() for part in parts])


def _differences(values: Complex, step: int) -> Complex:
    """Third differences over so many lines."""
    count = max(len(values) - 3 * step, 0)
    first, second, third, fourth = (values[k * step :][:count] for k in range(4))
    found: Complex = fourth - 3 * third + 3 * second - first
    return found
