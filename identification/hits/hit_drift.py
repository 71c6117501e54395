r"""Drift of the FRFs from hit to hit, before any change is put down to the level.

The FRF of hit h deviates from the mean H. To first order a change of gain and a shift of all
frequencies leave

    X_h / F_h - H = a_h H - b_h f dH/df + noise,

which weighted least squares solves for each channel. Gains a and shifts b are then regressed on the
number of the hit and on the logarithm of its peak together: what follows the number, given the
peak, is a drift (temperature, a stud that loosens), and no law of a joint.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import stdtr

from identification.hits.outliers import excited_lines
from identification.words import Complex, Output, Real

_MIN_DRIFT_HITS = 5  # the regression has three parameters: two degrees of freedom remain
_MAX_DRIFT_CHANCE = 1e-3  # that hits without a drift seem to have one, for all channels together
_MIN_TOTAL_DRIFT = 2e-3  # over the test, relative: a smaller one matters to no other result
_MIN_COMMON_SHARE = 0.5  # of the channels that drift alike: else single sensors are named
_MIN_SLOPE_TO_VARIANCE = 25.0  # |f dH/df|^2 over its noise, which would hide a shift otherwise
_TINY_CHANGE_VARIANCE = 1e-300  # avoids a division by zero


def describe_drift(
    force: Complex, motion: Complex, peak: Real, outputs: Sequence[Output], freq_hz: Real
) -> str | None:
    """Return what drifts from hit to hit as part of a sentence, or None.

    Args:
        force: spectra of the force of each hit, in order; (n_hit, n_freq).
        motion: spectra of the motion; (n_hit, n_freq, n_out).
        peak: peak of each hit [N]; (n_hit,).
        freq_hz: frequencies [Hz]; (n_freq,).
    """
    if len(peak) < _MIN_DRIFT_HITS:
        return None
    changes, variance = _changes_of_hits(force, motion, freq_hz)
    weights = 1 / np.maximum(variance, _TINY_CHANGE_VARIANCE)
    common = (changes * weights).sum(axis=1) / weights.sum(axis=0)
    rows = [_slope_by_number(common[:, kind], peak) for kind in (0, 1)]
    kind = int(rows[1][1] < rows[0][1])  # gain, or frequency if it follows the number more closely
    slope, chance = rows[kind]
    total = abs(slope) * (len(peak) - 1)
    if chance < _MAX_DRIFT_CHANCE and total > _MIN_TOTAL_DRIFT:
        which = _drifting_channels(changes[:, :, kind], peak, outputs)
        name = ("the gain", "the natural frequency")[kind]
        return _drift_clause(name + which, slope, len(peak))
    return _single_channels(changes[:, :, 0], peak, outputs)


def _changes_of_hits(force: Complex, motion: Complex, freq_hz: Real) -> tuple[Real, Real]:
    """Return gain and frequency shift of each hit and channel, and their variances.

    Returns:
        Changes (n_hit, n_out, 2) and variances (n_out, 2).
    """
    lines = excited_lines(force)
    ratio = motion[:, lines] / force[:, lines, None]
    freq = freq_hz[lines]
    mean = ratio.mean(axis=0)
    off = ratio - mean
    noise = np.maximum((np.abs(off) ** 2).sum(axis=0) / (len(ratio) - 1), _TINY_CHANGE_VARIANCE)
    slope = _frequency_slope(mean, noise / len(ratio), freq)
    basis = np.stack([mean, slope], axis=2) / np.sqrt(noise)[:, :, None]  # (n_freq, n_out, 2)
    normal = np.einsum("foi,foj->oij", basis.conj(), basis).real
    right = np.einsum("foi,hfo->hoi", basis.conj(), off / np.sqrt(noise)).real
    inverse = np.linalg.pinv(normal)
    return np.einsum("oij,hoj->hoi", inverse, right), np.einsum("oii->oi", inverse)


def _frequency_slope(mean: Complex, noise: Real, freq_hz: Real) -> Complex:
    """Return -f dH/df where it stands above its noise, else 0; (n_freq, n_out).

    Args:
        mean: FRFs; (n_freq, n_out).
        noise: variance of the FRFs; (n_freq, n_out).
    """
    if len(freq_hz) < 2:
        return np.zeros_like(mean)
    slope = -freq_hz[:, None] * np.gradient(mean, freq_hz, axis=0)
    # The central difference of independent lines d apart has the variance 2 v / (2 d)^2.
    of_noise = noise / 2 * (freq_hz / np.gradient(freq_hz))[:, None] ** 2
    return np.where(np.abs(slope) ** 2 > _MIN_SLOPE_TO_VARIANCE * of_noise, slope, 0.0)


def _slope_by_number(values: Real, peak: Real) -> tuple[float, float]:
    """Return the slope of a sequence by the number of the hit, given the peak, and its chance.

    The chance is that of a larger |t| without a drift (Student's t-test).
    """
    count = len(values)
    number, level = np.arange(count, dtype=float), np.log(np.abs(peak))
    design = np.stack([np.ones(count), number - number.mean(), level - level.mean()], axis=1)
    inverse = np.linalg.pinv(design.T @ design)
    fitted = inverse @ design.T @ values
    freedom = count - np.linalg.matrix_rank(design)
    residual = float(((values - design @ fitted) ** 2).sum()) / freedom
    deviation = float(np.sqrt(residual * inverse[1, 1]))
    slope = float(fitted[1])
    if deviation == 0:
        return slope, float(slope == 0)
    return slope, float(2 * stdtr(freedom, -abs(slope) / deviation))


def _drifting_channels(changes: Real, peak: Real, outputs: Sequence[Output]) -> str:
    """Return the channels that drift where these are few, as part of a sentence."""
    chances = np.array([_slope_by_number(values, peak)[1] for values in changes.T])
    drifting = np.flatnonzero(chances < _MAX_DRIFT_CHANCE / len(outputs))
    if not 0 < len(drifting) < _MIN_COMMON_SHARE * len(outputs):
        return ""
    return " of " + ", ".join(str(outputs[k]) for k in drifting.tolist())


def _single_channels(gains: Real, peak: Real, outputs: Sequence[Output]) -> str | None:
    """Return a drift of one channel that the mean over channels hides, or None."""
    slopes = [_slope_by_number(values, peak) for values in gains.T]
    for output, (slope, chance) in zip(outputs, slopes, strict=True):
        total = abs(slope) * (len(peak) - 1)
        if chance < _MAX_DRIFT_CHANCE / len(outputs) and total > _MIN_TOTAL_DRIFT:
            return _drift_clause(f"the gain of {output}", slope, len(peak))
    return None


def _drift_clause(name: str, slope: float, hits: int) -> str:
    """Return what changes from hit to hit by how much."""
    return (
        f"{name} {'rises' if slope > 0 else 'falls'} by {100 * abs(slope):.2g} % from hit to hit "
        f"({100 * abs(slope) * (hits - 1):.2g} % over {hits} hits)"
    )
