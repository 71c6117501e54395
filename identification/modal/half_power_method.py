"""Single-mode methods: half-power damping, and the amplitude by least squares and by the peak.

These methods check the fitted poles and do not replace them: each formula assumes that one mode is
alone. Equation numbers are those of the paper on the gondola (seed
balloon-gondola-modal-identification), time convention exp(+i w t). One mode alone, measured as

    y(i w) = C H(i w),   H = s^q w_r^(2 - q) / (s^2 + 2 zeta w_r s + w_r^2),   s = i w

with q = 2 for accelerance, is eq. 10b and 11. At resonance y(i w_r) = i C / (2 zeta) (eq. 13); for
q = 1 it is C / (2 zeta), for q = 0 it is -i C / (2 zeta). C is signed: two channels that move in
opposite directions have values of C with opposite signs (eq. 19).
"""

import numpy as np

from identification.words import Complex, InputError, Real, UsageError

_HALF_POWER_RATIO = np.sqrt(0.5)  # amplitude over that of the peak, 3 dB below it


def half_power_damping(freq_hz: Real, amplitude: Real, peak: int) -> tuple[float, float, float]:
    """Estimate the damping ratio from the half-power bandwidth: zeta = (w_2 - w_1) / (2 w_r).

    This is eq. 15 and 16. The amplitude falls to 1 / sqrt(2) of the peak at w_1 and w_2,
    interpolated linearly between frequency lines. The relative error of the formula is 3 zeta^2 /
    2. A line spacing of d biases it by up to d^2 / (zeta f)^2 / 4, since the peak falls between two
    lines.

    Args:
        freq_hz: lines, rising [Hz]; (n_freq,).
        amplitude: |y|; (n_freq,).
        peak: number of the line of the peak.

    Returns:
        zeta, and the frequencies f_1 and f_2 [Hz].

    Raises:
        InputError: the amplitude rises again, or the band ends, before it has fallen by 3 dB.
    """
    level = amplitude[peak] * _HALF_POWER_RATIO
    lower = _crossing(freq_hz, amplitude, peak, level, -1)
    upper = _crossing(freq_hz, amplitude, peak, level, 1)
    return half_power(lower, upper, float(freq_hz[peak])), lower, upper


def half_power(lower: float, upper: float, centre: float) -> float:
    """Return zeta = (w_2 - w_1) / (2 w_r) (eq. 16), all three in one unit."""
    return (upper - lower) / (2 * centre)


def _crossing(freq_hz: Real, amplitude: Real, peak: int, level: float, step: int) -> float:
    """Return the frequency [Hz] where the amplitude first falls to a level, beside the peak."""
    line = peak
    while 0 <= line + step < len(amplitude):
        neighbour = line + step
        if amplitude[neighbour] > amplitude[peak]:
            break
        if amplitude[neighbour] <= level:
            share = (amplitude[line] - level) / (amplitude[line] - amplitude[neighbour])
            return float(freq_hz[line] + share * (freq_hz[neighbour] - freq_hz[line]))
        line = neighbour
    side = "below" if step < 0 else "above"
    raise InputError(
        f"the peak at {freq_hz[peak]:.4g} Hz does not fall by 3 dB {side} it before the band ends "
        "or a higher peak comes: use the damping of a circle fit or of the fitted poles"
    )


def unit_response(freq_hz: Real, natural_hz: float, damping: float, order: int = 2) -> Complex:
    """Return the response H of one mode with C = 1: eq. 11 for the accelerance; (n_freq,).

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        natural_hz: w_r / 2 pi [Hz].
        damping: zeta.
        order: q: 0, 1, 2 for receptance, mobility, accelerance.
    """
    ratio = 1j * np.asarray(freq_hz) / natural_hz
    return ratio**order / (ratio**2 + 2 * damping * ratio + 1)


def least_squares_amplitude(values: Complex, response: Complex) -> Real:
    """Estimate C of every channel by least squares: sum Re(Y* H) / sum |H|^2 (eq. 18), signed.

    Args:
        values: Y at some lines around the peak; (n_freq, ...).
        response: H at these lines; (n_freq,).

    Returns:
        C in the unit of the values; (...).

    Raises:
        UsageError: no line.
    """
    if not len(response):
        raise UsageError("no frequency line to fit an amplitude to: give lines around the peak")
    shaped = response.reshape(-1, *(1,) * (values.ndim - 1))
    return (values.conj() * shaped).real.sum(axis=0) / (np.abs(response) ** 2).sum()


def peak_amplitude(value: Complex, damping: float, order: int = 2) -> Real:
    """Estimate C of every channel from the value at resonance: C = 2 zeta Im y(i w_r), signed.

    For the accelerance y(i w_r) = i C / (2 zeta) (eq. 13, 16). For the other quantities the
    resonance lies on another axis: C = 2 zeta Re(y / i^(q - 1)).

    Args:
        value: y at the natural frequency; (...).
        damping, order: as for ``unit_response``.
    """
    return 2 * damping * (np.asarray(value) / 1j ** (order - 1)).real


def relative_difference(reference: Real, amplitude: Real) -> Real:
    """Return the absolute difference of two amplitudes relative to the reference, as in table 3."""
    return np.abs(np.asarray(amplitude) - reference) / np.abs(reference)
