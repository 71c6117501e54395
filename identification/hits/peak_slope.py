r"""Derivative of FRFs by the peak of the hits, from the scatter of the peaks within one test.

Hits by hand differ in their peak. With q_h the logarithm of a hit's peak over the mean, the model

    X_h = (H + q_h D) F_h + noise

is linear in H and D. Least squares over the hits, with S_k = sum q^k |F|^2, give at each line

    D = (S_0 sum q X F* - S_1 sum X F*) / (S_0 S_2 - S_1^2),

and its variance follows from the residual, with two degrees of freedom less than there are hits. D
is zero for a linear machine; where it is not, one test already shows that the level matters.
"""

import numpy as np

from identification.words import Complex, PeakSlope, Real

_MIN_SLOPE_HITS = 5  # three degrees of freedom of the noise
_MIN_PEAK_SPREAD = 0.02  # standard deviation of ln(peak) below which hits have one level
_VARIANCE_LINES = 25  # lines over which the variance is averaged


def estimate_peak_slope(force: Complex, motion: Complex, peak: Real) -> PeakSlope | None:
    """Return the derivative of the FRFs by the logarithm of the peak; None if the peaks are alike.

    Args:
        force: spectra of the force; (n_hit, n_freq).
        motion: spectra of the motion; (n_hit, n_freq, n_out).
        peak: peak of each hit; (n_hit,).
    """
    level = np.log(np.abs(peak))
    level -= level.mean()
    spread = float(level.std())
    if len(peak) < _MIN_SLOPE_HITS or spread < _MIN_PEAK_SPREAD:
        return None
    power = np.abs(force) ** 2
    zeroth, first, second = (np.einsum("h,hf->f", level**k, power) for k in range(3))
    products = [
        np.einsum("h,hfo,hf->fo", level**k, motion, force.conj(), optimize=True) for k in range(2)
    ]
    determinant = zeroth * second - first**2
    safe = np.where(determinant > 0, determinant, np.inf)[:, None]
    slope = (zeroth[:, None] * products[1] - first[:, None] * products[0]) / safe
    mean = (second[:, None] * products[0] - first[:, None] * products[1]) / safe
    off = motion - (mean + level[:, None, None] * slope) * force[:, :, None]
    noise = (np.abs(off) ** 2).sum(axis=0) / (len(peak) - 2)
    kernel = np.ones(_VARIANCE_LINES)
    counts = np.convolve(np.ones(len(noise)), kernel, mode="same")
    smooth = np.stack([np.convolve(row, kernel, mode="same") / counts for row in noise.T], axis=1)
    return PeakSlope(slope, smooth * zeroth[:, None] / safe, spread)
