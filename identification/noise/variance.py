"""Variance of measured FRFs, from coherence or from differences along frequency."""

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from identification.words import Complex, FrfEstimate, Real

# Coherences are clipped to this range: 0 and 1 would mean infinite and zero variance.
_MIN_COHERENCE, _MAX_COHERENCE = 1e-4, 1 - 1e-7
_TINY_SQUARED_FRF = 1e-300  # avoids a division by zero
_MEDIAN_LINES = 31  # lines of the running median of squared differences
_MIN_HALF_WINDOW = 2  # lines on either side, in the shorter windows towards 0 Hz
# The variance from n hits has 2 (n - 1) degrees of freedom at each line. Noise changes slowly along
# frequency, so the variance is averaged over lines up to this many degrees of freedom. It then
# scatters by 14 %, its mean over channels by far less, and weights by it are not biased.
_DEGREES_OF_FREEDOM = 100


def coherence_variance(values: Complex, coherence: Real, averages: int) -> Real:
    """Compute the variance of H1 from the ordinary coherence.

    The sum of the variances of real and imaginary part is, for one input (Bendat and Piersol 2010,
    ch. 9), with coherence g2 and n averages,

        E|error|^2 = |H|^2 (1 - g2) / (g2 (n - 1))

    Args:
        values: FRFs H; any shape.
        coherence: ordinary coherence g2; the shape of ``values``.
        averages: number n of averaged hits, at least 2.

    Returns:
        E|error|^2 [square of the unit of the FRFs]; the shape of ``values``.
    """
    clipped = np.clip(coherence, _MIN_COHERENCE, _MAX_COHERENCE)
    return np.abs(values) ** 2 * (1 - clipped) / (clipped * (averages - 1))


def several_input_variance(
    values: Complex, multiple_coherence: Real, input_spectra: Complex, averages: int
) -> Real:
    r"""Compute the variance of FRFs whose inputs acted at once, from the multiple coherence.

    With the averaged spectra S_xx of q inputs, the multiple coherence g2 of an output and n
    averages (Bendat and Piersol 2010, ch. 9),

        S_yy = H S_xx H^H / g2
        cov(H_yi, H_yj) = (1 - g2) S_yy [S_xx^-1]_ij / (n - q)

    One input gives the formula of ``coherence_variance``. The errors of the references of one
    output are correlated where inputs are; the diagonal alone is returned, since every test is one
    reference, and fits weigh tests as independent. The variance of each value is then right, and
    what correlated errors share counts once for each reference.

    Args:
        values: FRFs H; (n_freq, n_out, n_in).
        multiple_coherence: g2 of each output; (n_freq, n_out).
        input_spectra: S_ij, the mean of x_i conj(x_j), up to a common factor a line;
            (n_freq, n_in, n_in).
        averages: number n of averages, more than n_in.

    Returns:
        E|error|^2 [square of the unit of the FRFs]; (n_freq, n_out, n_in).
    """
    clipped = np.clip(multiple_coherence, _MIN_COHERENCE, _MAX_COHERENCE)
    explained = np.einsum("foi,fij,foj->fo", values, input_spectra, values.conj()).real
    noise = explained * (1 - clipped) / clipped / (averages - values.shape[2])
    inverse = np.einsum("fii->fi", np.linalg.inv(input_spectra)).real
    return noise[:, :, None] * inverse[:, None, :]


def implied_coherence(values: Complex, variance: Real, averages: int) -> Real:
    """Compute the ordinary coherence that a variance of H1 implies: 1 / (1 + (n - 1) v / |H|^2).

    Args:
        values: FRFs H; any shape.
        variance: E|error|^2; the shape of ``values``.
        averages: number n of averages, at least 2.
    """
    ratio = (averages - 1) * variance / np.maximum(np.abs(values) ** 2, _TINY_SQUARED_FRF)
    return np.asarray(1 / (1 + ratio), float)


def difference_variance(values: Complex) -> Real:
    """Estimate the variance of FRFs from third differences along frequency.

    This difference-based variance estimator serves tests without coherence or number of averages.
    White noise of variance v gives third differences of variance 20 v (1 + 9 + 9 + 1); a smooth FRF
    hardly contributes. |difference|^2 has an exponential distribution, so its running median over
    31 lines is ln 2 times its mean. Sharp resonances raise the estimate, which is then an upper
    bound. The last lines have the median of the last 31.

    Towards 0 Hz the noise of buildings and sensors rises steeply. At the first lines, windows that
    reach half the line number to either side count too; the larger estimate is used.

    Args:
        values: FRFs H; (n_freq, ...), at least 4 lines.

    Returns:
        E|error|^2 [square of the unit of the FRFs]; the shape of ``values``.

    Raises:
        ValueError: there are fewer than 4 lines.
    """
    if len(values) < 4:
        raise ValueError(f"{len(values)} lines are too few for third differences, which need 4")
    squares = np.abs(np.diff(values, 3, axis=0)) ** 2 / 20
    window = (min(_MEDIAN_LINES, len(squares)),) + (1,) * (values.ndim - 1)
    smooth = median_filter(squares, size=window, mode="nearest") / np.log(2)
    last = len(smooth) - (window[0] - 1) // 2  # from here on the filter repeats the last difference
    smooth[last:] = smooth[last - 1]
    for line in range(min(_MEDIAN_LINES, len(squares))):
        half = max(_MIN_HALF_WINDOW, line // 2)
        near = squares[max(0, line - half) : line + half + 1]
        smooth[line] = np.maximum(smooth[line], np.median(near, axis=0) / np.log(2))
    edges = np.clip(np.arange(len(values)) - 1, 0, len(squares) - 1)
    return smooth[edges]


def smooth_variance(estimate: FrfEstimate) -> Real:
    """Average the variance over neighbouring lines, which removes the scatter of few hits.

    Weights need such a variance. One from differences is smooth already, and one that the file
    states is used as it is.

    Args:
        estimate: FRFs with their variance.

    Returns:
        E|error|^2 [square of the unit of the FRFs]; (n_freq, n_out, n_in).
    """
    variance = estimate.variance
    if estimate.variance_source != "coherence":
        return variance  # differences are smoothed already, and stated variances stay as they are
    return average_over_lines(variance, 2 * ((estimate.averages or 2) - 1))


def average_over_lines(variance: Real, degrees_of_freedom: float) -> Real:
    """Return variances averaged over neighbouring lines, up to 100 degrees of freedom.

    Args:
        variance: E|error|^2; (n_freq, ...).
        degrees_of_freedom: of the variance at each line.
    """
    width = 2 * int(np.ceil(_DEGREES_OF_FREEDOM / max(degrees_of_freedom, 1) / 2)) + 1
    return uniform_filter1d(variance, min(width, len(variance)), axis=0, mode="nearest")
