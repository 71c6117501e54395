r"""The hand methods for one mode: half-power damping, amplitude by eq. 18 and by the peak.

What stands here is a check beside the poles that were fitted, no replacement: each formula takes
one mode to be alone. Numbers of equations are those of the gondola's paper (seed
balloon-gondola-modal-identification), time convention exp(+i w t). One mode alone, measured as

    y(i w) = C H(i w),   H = s^q w_r^(2 - q) / (s^2 + 2 zeta w_r s + w_r^2),   s = i w

with q = 2 for accelerance is eq. 10b and 11. There y(i w_r) = i C / (2 zeta) (eq. 13); with q = 1
it is C / (2 zeta), with q = 0 it is -i C / (2 zeta). C carries a sign: of two channels of one mode
that move against each other the two values differ in it (eq. 19).
"""

import numpy as np

from identification.words import Complex, InputError, Real, UsageError

_HALF = np.sqrt(0.5)  # 3 dB below


def half_power_damping(freq_hz: Real, amplitude: Real, peak: int) -> tuple[float, float, float]:
    """Damping ratio from the width of a peak: zeta = (w_2 - w_1) / (2 w_r) (eq. 15 and 16).

    w_1 and w_2 are where the amplitude falls to 1 / sqrt(2) of the peak's, straight lines between
    the lines. The formula is right to first order of zeta, 3 zeta^2 / 2 relative; a line spacing
    of d biases it by up to d^2 / (zeta f)^2 / 4, as the peak falls between two lines.

    Args:
        freq_hz: lines, rising [Hz]; (n_freq,).
        amplitude: |y|; (n_freq,).
        peak: number of the line of the peak.

    Returns:
        zeta, and the frequencies f_1 and f_2 [Hz].

    Raises:
        InputError: the amplitude rises again, or the band ends, before it has fallen by 3 dB.
    """
    level = amplitude[peak] * _HALF
    lower = _crossing(freq_hz, amplitude, peak, level, -1)
    upper = _crossing(freq_hz, amplitude, peak, level, 1)
    return half_power(lower, upper, float(freq_hz[peak])), lower, upper


def half_power(lower: float, upper: float, centre: float) -> float:
    """Eq. 16: zeta = (w_2 - w_1) / (2 w_r), all in one unit."""
    return (upper - lower) / (2 * centre)


def _crossing(freq_hz: Real, amplitude: Real, peak: int, level: float, step: int) -> float:
    """Where the amplitude first falls to a level, on one side of the peak [Hz]."""
    here = peak
    while 0 <= here + step < len(amplitude):
        there = here + step
        if amplitude[there] > amplitude[peak]:
            break
        if amplitude[there] <= level:
            part = (amplitude[here] - level) / (amplitude[here] - amplitude[there])
            return float(freq_hz[here] + part * (freq_hz[there] - freq_hz[here]))
        here = there
    side = "below" if step < 0 else "above"
    raise InputError(
        f"the peak at {freq_hz[peak]:.4g} Hz does not fall by 3 dB {side} it before the band ends "
        "or a higher peak comes: take its damping from a circle or from the poles"
    )


def unit_response(freq_hz: Real, natural_hz: float, damping: float, order: int = 2) -> Complex:
    """H of one mode whose C is 1: eq. 11 for the accelerance (order 2); (n_freq,).

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        natural_hz: w_r / 2 pi [Hz].
        damping: zeta.
        order: q: 0, 1, 2 for receptance, mobility, accelerance.
    """
    ratio = 1j * np.asarray(freq_hz) / natural_hz
    response: Complex = ratio**order / (ratio**2 + 2 * damping * ratio + 1)
    return response


def least_squares_amplitude(values: Complex, response: Complex) -> Real:
    """C of every channel by eq. 18: sum Re(Y* H) / sum |H|^2, signed, in the unit of the values.

    Args:
        values: Y at some lines around the peak; (n_freq, ...).
        response: H there; (n_freq,).

    Returns:
        (...).

    Raises:
        UsageError: no line.
    """
    if not len(response):
        raise UsageError("no line to fit an amplitude to: give lines around the peak")
    shaped = response.reshape(-1, *(1,) * (values.ndim - 1))
    amplitude: Real = (values.conj() * shaped).real.sum(axis=0) / (np.abs(response) ** 2).sum()
    return amplitude


def peak_amplitude(value: Complex, damping: float, order: int = 2) -> Real:
    """C of every channel from the value at resonance: C = 2 zeta Im y(i w_r) (eq. 13, 16), signed.

    For the accelerance y(i w_r) = i C / (2 zeta); of the other quantities the axis on which the
    resonance lies is turned: C = 2 zeta Re(y / i^(q - 1)).

    Args:
        value: y at the natural frequency; (...).
        damping: zeta.
        order: q: 0, 1, 2 for receptance, mobility, accelerance.
    """
    amplitude: Real = 2 * damping * (np.asarray(value) / 1j ** (order - 1)).real
    return amplitude


def difference(one: Real, other: Real) -> Real:
    """How far the second amplitude is from the first, relative to it, as in table 3."""
    apart: Real = np.abs(np.asarray(other) - one) / np.abs(one)
    return apart
