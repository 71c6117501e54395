r"""Records of a force that repeats, at a rate of which its period is a whole number of samples.

A signal from another clock repeats after P samples, P no whole number. Blocks of whole samples then
begin elsewhere in each period, and their lines are not those of the force: narrow modes come out
wider. Between spectra X_0 and X_j of equal stretches, j periods of P_0 samples apart, the phase is

    arg X_j conj(X_0) = -w j (P - P_0),

w in radians a sample. A straight line through it, weighted by |X_j X_0|, gives P; j grows by twos,
so that the phase is never more than a turn off. Splines then give all signals at multiples of
P / P_0 samples.
"""

from dataclasses import replace

import numpy as np
import scipy.fft
from scipy.interpolate import make_interp_spline

from identification.continuous.plan import find_period
from identification.hits.settings import HitSettings
from identification.words import InputError, Real, Records

_MAX_DRIFT = 1e-3  # samples over a record: less moves no line of it by a thousandth of its width
_MIN_SIGNIFICANCE = 5.0  # of a period that is not whole, in standard deviations
_SPLINE_DEGREE = 7


def align_periods(
    records: Records, settings: HitSettings
) -> tuple[Records, int | None, tuple[str, ...]]:
    """Return records whose period is a whole number of samples, this number, and a remark.

    Args:
        records: of one reference.
        settings: ``period_s`` states the period; with ``block_s`` none is sought.

    Returns:
        The records as they are and None where the force does not repeat.

    Raises:
        InputError: a stated period that fits less than twice into a record.
    """
    n_sample = records.force.shape[1]
    repeated = records.set_points[0] if len(records.set_points) else records.force
    period_s = settings.period_s
    if period_s is None:
        whole = None if settings.block_s is not None else find_period(repeated)
        if whole is None:
            return records, None, ()
        length = find_exact_period(repeated, whole)
    else:
        length = period_s * records.rate_hz
        whole = round(length)
    if not 2 <= 2 * whole <= n_sample:
        raise InputError(
            f"{records.test}: a period of {period_s:g} s does not fit twice into records of "
            f"{n_sample / records.rate_hz:.4g} s: correct period, or record longer"
        )
    if abs(length - whole) * n_sample / whole <= _MAX_DRIFT:
        return records, whole, ()
    remark = (
        f"{records.test}: the force along {records.reference} repeats each {length:.8g} samples "
        f"({length / records.rate_hz:.8g} s), which is no whole number: all signals are "
        f"interpolated at {whole} samples a period"
    )
    return _resample(records, length / whole), whole, (remark,)


def find_exact_period(force: Real, whole: int) -> float:
    """Return the samples after which a force repeats; the whole number where it may well be one.

    Args:
        force: one input; (n_record, n_sample).
        whole: nearest whole number of samples.
    """
    n_block = force.shape[1] // whole
    blocks = force[:, : n_block * whole].reshape(len(force), n_block, whole)
    spectra = scipy.fft.rfft(blocks - blocks.mean(axis=2, keepdims=True), axis=2)[..., 1:]
    omega = 2 * np.pi * np.arange(1, spectra.shape[-1] + 1) / whole
    excess, deviation, distance = 0.0, 0.0, 1
    while distance < n_block:
        later, earlier = spectra[:, distance:], spectra[:, :-distance]
        product = (later * earlier.conj()).sum(axis=(0, 1)) * np.exp(1j * omega * distance * excess)
        weight, phase = np.abs(product), np.angle(product)
        moment = (weight * (distance * omega) ** 2).sum()
        if not moment > 0:
            return float(whole)
        step = -(weight * distance * omega * phase).sum() / moment
        rest = phase + distance * omega * step
        excess += step
        scatter = ((weight * distance * omega * rest) ** 2).sum()
        deviation = float(np.sqrt(scatter)) / moment
        distance *= 2
    is_whole = abs(excess) <= _MIN_SIGNIFICANCE * deviation
    return float(whole) if is_whole else whole + excess


def _resample(records: Records, step: float) -> Records:
    """Return records at multiples of ``step`` samples."""
    n_sample = records.force.shape[1]
    places = step * np.arange(int((n_sample - 1) / step) + 1)

    def interpolate(signals: Real) -> Real:
        """Return signals at the places; (.., n_place)."""
        if not len(signals):
            return signals
        spline = make_interp_spline(np.arange(n_sample), signals, _SPLINE_DEGREE, axis=-1)
        return np.asarray(spline(places))

    return replace(
        records,
        rate_hz=records.rate_hz / step,
        force=interpolate(records.force),
        motion=interpolate(records.motion),
        further_forces=interpolate(records.further_forces),
        set_points=interpolate(records.set_points),
    )
