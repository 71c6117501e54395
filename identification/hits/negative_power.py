r"""Reasons why a drive point takes power from the hammer: direction, quantity or delay.

A reversed direction, receptance read as accelerance (or the reverse) and a delay all make Re Y
negative at resonances. With the right quantity, sign and time, Y has a power share of 1.

Direction and a quantity wrong by two orders give the same phase. Foster's reactance theorem tells
them apart: away from resonances, where Y is nearly imaginary, d ln|Y| / d ln w is at least 1 where
the point is a spring (Im Y > 0) and at most -1 where it is a mass (Im Y < 0). For Y times w^2 or
w^-2 this fails on one side of each resonance. It tells conjugated FRFs too, which read as -Y* if
they are accelerances or receptances: their power is negative, but their reactance is right.

A hammer beside its point makes some modes take power, which a delay by half their periods feigns.
But a delay turns the phases of all channels, while a hammer at another place leaves them at 0 or
180 degrees at resonances: the squares of all mobilities, which know no sign, tell both apart. Where
few lines lie on narrow resonances, a delay may feign their power too; but it turns the phase of the
many lines between them, where motion and force are in quadrature.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import DERIVATIVE_ORDER, Complex, Quantity, Real

_MIN_EXPLAINED_SHARE = 0.95  # power share of a drive point with its fault removed
_MIN_SHARE_GAIN = 0.1  # by which a delay or quantity must explain more than a reversed direction
_PEAK_LOG_WIDTH = 0.05  # of ln f: a resonance is the largest power within 5 % to either side
# Gain of the score of phases from which a delay is one: 0.5 ms at modes around 50 Hz give 0.05.
_MIN_PHASE_GAIN = 0.05
_MAX_DELAY_S = 0.05  # delays that are searched
_DELAYS_PER_PERIOD = 10  # steps of delay in one period of the highest frequency
_MAX_DELAY_STEPS = 4000  # in all, which bounds the work for high frequencies
_MIN_QUADRATURE = 0.9  # |Im Y| / |Y| away from resonances
_SLOPE_LOG_WIDTH = 0.06  # of ln f: width over which the slope of ln |Y| is taken
_MIN_FOSTER_SLOPE = 0.7  # least |d ln|Y| / d ln w| away from resonances: 1 less what noise adds
_MIN_VIOLATION_DIFFERENCE = 0.05  # share of lines against Foster's theorem that decides


@dataclass(frozen=True, eq=False)
class DrivePointMobility:
    """Mobility of a drive point on lines above its noise.

    Args:
        freq_hz: frequencies [Hz]; (n_line,).
        laplace: s of each line [rad/s]; (n_line,).
        values: mobility according to the stated quantity, along the hammer; (n_line,).
        quantity: stated quantity.
        deviation: standard deviation of the real part; (n_line,).
        channels: mobilities of all channels of the test; (n_line, n_channel).
    """

    freq_hz: Real
    laplace: Complex
    values: Complex
    quantity: Quantity
    deviation: Real
    channels: Complex

    def as_if(self, quantity: Quantity) -> Complex:
        """Return the mobility if the file held another quantity; (n_line,)."""
        order = DERIVATIVE_ORDER[self.quantity] - DERIVATIVE_ORDER[quantity]
        return self.values * self.laplace**order


def power_share(mobility: Complex) -> float:
    """Return sum c |c| / sum c^2 with c = Re Y / |Y|: 1 for a passive drive point."""
    power = mobility.real / np.abs(mobility)
    return float((power * np.abs(power)).sum() / (power**2).sum())


def explain_negative_power(point: DrivePointMobility, place: str) -> str | None:
    """Return a sentence on a wrong quantity or a delay; None if the direction may be reversed.

    Args:
        point: mobility of the drive point.
        place: channel and hammer, for the sentence.
    """
    share = power_share(point.values)
    quantity, excludes_reversal = _find_quantity(point, abs(share))
    if _is_conjugated(point, share, quantity):
        return (
            f"{place} has the power of a reversed hammer but the reactance of a right one, as FRFs "
            'of the other time convention have: set time_sign = "-" in its [[test]], or remove it'
        )
    if quantity is not None and excludes_reversal:
        return (
            f"{place} behaves as {quantity}, not {point.quantity}: set "
            f'quantity = "{quantity}" in its [[test]]'
        )
    if quantity is not None:
        return (
            f"{place} reads with the opposite sign, or holds {quantity}: check both directions, or "
            f'set quantity = "{quantity}" in its [[test]]'
        )
    delay_s, delayed_share = _find_delay(point)
    is_explained = delayed_share >= max(_MIN_EXPLAINED_SHARE, abs(share) + _MIN_SHARE_GAIN)
    turn, turn_as_read = (_turn_from_quadrature(point, delay) for delay in (delay_s, 0.0))
    if not is_explained or turn > turn_as_read:
        return None
    if _peak_phase_score(point, delay_s) < _peak_phase_score(point, 0.0) + _MIN_PHASE_GAIN:
        return (
            f"{place} takes power from the hammer at some resonances, and no delay: the phases of "
            "the other channels are right; check the places of hammer and sensor"
        )
    late = "lags" if delay_s > 0 else "leads"
    return (
        f"at {place} the motion {late} the force by {1e3 * abs(delay_s):.2g} ms: a delay between "
        "their channels, not an opposite sign; remove it in the export"
    )


def _turn_from_quadrature(point: DrivePointMobility, delay_s: float) -> float:
    """Return the median of |Re Y| / |Y|: between resonances a delay turns motion towards force."""
    mobility = point.values * np.exp(2j * np.pi * point.freq_hz * delay_s)
    return float(np.median(np.abs(mobility.real) / np.abs(mobility)))


def _peak_phase_score(point: DrivePointMobility, delay_s: float) -> float:
    """Return how close the phases of all channels at resonances are to 0 or 180 degrees.

    The score is the mean over resonances of sum Re(Y^2 exp(2 i w delay)) / sum |Y|^2, summed over
    channels: 1 for real mode shapes, and the cosine of 2 w times an error of the delay.
    """
    power = (np.abs(point.channels) ** 2).sum(axis=1)
    log_freq = np.log(point.freq_hz)
    first = np.searchsorted(log_freq, log_freq - _PEAK_LOG_WIDTH)
    last = np.searchsorted(log_freq, log_freq + _PEAK_LOG_WIDTH, side="right")
    peaks = [
        line
        for line, (start, stop) in enumerate(zip(first, last, strict=True))
        if start < line < stop - 1 and power[line] >= power[start:stop].max() > 0
    ]
    if not peaks:
        return 0.0
    turn = np.exp(4j * np.pi * point.freq_hz[peaks] * delay_s)
    squares = (point.channels[peaks] ** 2).sum(axis=1) * turn
    return float((squares.real / power[peaks]).mean())


def _is_conjugated(point: DrivePointMobility, share: float, quantity: Quantity | None) -> bool:
    """Return whether conjugated FRFs obey Foster's theorem, and no other reason does as well."""
    if share > -_MIN_EXPLAINED_SHARE:
        return False
    rivals = [_foster_violation(point, -point.values)]
    if quantity is not None:
        rivals.append(_foster_violation(point, point.as_if(quantity)))
    violation = _foster_violation(point, -point.values.conj())
    return violation < min(rivals) - _MIN_VIOLATION_DIFFERENCE


def _find_quantity(point: DrivePointMobility, share: float) -> tuple[Quantity | None, bool]:
    """Return another quantity whose drive point is passive, and whether it excludes a reversal.

    It must explain more than the stated quantity with either sign, whose share is ``share``, or
    agree better with Foster's theorem.
    """
    shares = {
        quantity: power_share(point.as_if(quantity))
        for quantity in DERIVATIVE_ORDER
        if quantity != point.quantity
    }
    likely = {quantity: share for quantity, share in shares.items() if share > _MIN_EXPLAINED_SHARE}
    if not likely:
        return None, False
    best = max(likely, key=lambda quantity: likely[quantity])
    if likely[best] > share + _MIN_SHARE_GAIN:
        return best, True
    reversed_violation = _foster_violation(point, -point.values)
    difference = reversed_violation - _foster_violation(point, point.as_if(best))
    if difference < -_MIN_VIOLATION_DIFFERENCE:
        return None, False
    return best, difference > _MIN_VIOLATION_DIFFERENCE


def _foster_violation(point: DrivePointMobility, mobility: Complex) -> float:
    """Return the share of lines away from resonances where |Y| has not the slope of its phase."""
    log_freq, level = np.log(point.freq_hz), np.log(np.abs(mobility))
    ahead = np.interp(log_freq + _SLOPE_LOG_WIDTH / 2, log_freq, level)
    behind = np.interp(log_freq - _SLOPE_LOG_WIDTH / 2, log_freq, level)
    quadrature = mobility.imag / np.abs(mobility)
    inside = (log_freq > log_freq[0] + _SLOPE_LOG_WIDTH) & (
        log_freq < log_freq[-1] - _SLOPE_LOG_WIDTH
    )
    chosen = inside & (np.abs(quadrature) > _MIN_QUADRATURE)
    if not chosen.any():
        return 0.0
    slope = quadrature * (ahead - behind) / _SLOPE_LOG_WIDTH
    return float(np.mean(slope[chosen] < _MIN_FOSTER_SLOPE))


def _find_delay(point: DrivePointMobility) -> tuple[float, float]:
    """Return the delay [s] of motion after force with the largest power share, and that share."""
    step = max(
        1 / (_DELAYS_PER_PERIOD * float(point.freq_hz[-1])), 2 * _MAX_DELAY_S / _MAX_DELAY_STEPS
    )
    count = int(_MAX_DELAY_S / step)
    delays = step * np.arange(-count, count + 1)
    shares = [
        power_share(point.values * np.exp(2j * np.pi * point.freq_hz * delay)) for delay in delays
    ]
    best = int(np.argmax(shares))
    return float(delays[best]), shares[best]
