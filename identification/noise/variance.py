"""How well each complex FRF value is known."""

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from identification.words import Complex, FrfEstimate, Real

# Coherences are clipped here: 0 and 1 stand for "no" and "perfect" knowledge, which no data give.
_LOWEST, _HIGHEST = 1e-4, 1 - 1e-7
_WINDOW = 31  # lines
_SHORTEST = 2  # lines on either side
# A variance from n hits has 2 (n - 1) degrees of freedom a line. Noise changes slowly along
# frequency: averaged over lines to this many, the variance scatters by 14 %, its mean over
# channels by far less, and weights by it are not biased.
_DEGREES = 100


def coherence_variance(values: Complex, coherence: Real, averages: int) -> Real:
    """Variance of H1, real plus imaginary part: |H|^2 (1 - g2) / (g2 (n - 1)).

    Args:
        values: H; any shape.
        coherence: ordinary coherence g2; the same shape.
        averages: hits n, at least 2.

    Returns:
        E|error|^2; the same shape (Bendat and Piersol 2010, ch. 9, for one input).
    """
    clipped = np.clip(coherence, _LOWEST, _HIGHEST)
    variance: Real = np.abs(values) ** 2 * (1 - clipped) / (clipped * (averages - 1))
    return variance


def difference_variance(values: Complex) -> Real:
    """Variance from third differences along frequency, for tests without coherence or averages.

    White noise of variance v gives third differences of variance 20 v (1 + 9 + 9 + 1), a smooth
    FRF none; |difference|^2 is exponential, so its running median over 31 lines is ln 2 of its
    mean. Sharp resonances raise it: an upper bound where the lines are too few. The last lines have
    the median of the last 31. Towards 0 Hz the noise of buildings and sensors rises steeply: at the
    first lines, shorter windows, half as wide as the frequency is high, count where they say more.

    Args:
        values: H; (n_freq, ...), at least 4 lines.

    Returns:
        E|error|^2; the same shape.
    """
    if len(values) < 4:
        raise ValueError(f"{len(values)} lines are too few for third differences")
    squares = np.abs(np.diff(values, 3, axis=0)) ** 2 / 20
    window = (min(_WINDOW, len(squares)),) + (1,) * (values.ndim - 1)
    smooth = median_filter(squares, size=window, mode="nearest") / np.log(2)
    last = len(smooth) - (window[0] - 1) // 2  # from there the filter repeats the last difference
    smooth[last:] = smooth[last - 1]
    for line in range(min(_WINDOW, len(squares))):
        half = max(_SHORTEST, line // 2)
        near = squares[max(0, line - half) : line + half + 1]
        smooth[line] = np.maximum(smooth[line], np.median(near, axis=0) / np.log(2))
    edges = np.clip(np.arange(len(values)) - 1, 0, len(squares) - 1)
    variance: Real = smooth[edges]
    return variance


def smooth_variance(estimate: FrfEstimate) -> Real:
    """Variance without the scatter of few hits: averaged over neighbouring lines, as weights need.

    Args:
        estimate: FRFs with their variance.

    Returns:
        E|error|^2; (n_freq, n_out, n_in).
    """
    variance = estimate.variance
    if estimate.variance_source != "coherence":
        return variance  # differences are smoothed already
    hits = estimate.averages or 2
    width = 2 * int(np.ceil(_DEGREES / max(2 * (hits - 1), 1) / 2)) + 1
    smooth: Real = uniform_filter1d(variance, min(width, len(variance)), axis=0, mode="nearest")
    return smooth
