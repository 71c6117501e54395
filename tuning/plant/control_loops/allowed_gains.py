r"""Gains that the modulus margin of a loop allows, and notches.

With L the gain of a loop, |1 + g L| < m holds between the roots of

    |L|^2 g^2 + 2 Re(L) g + 1 - m^2 = 0,

so that each line of frequency forbids the gains between them. A notch

    (s^2 + 2 d z w s + w^2) / (s^2 + 2 z w s + w^2)

lowers L at w by d.
"""

import numpy as np

from identification.words import Complex, Real
from tuning.plant.control_loops.loop_gain_lines import LoopGainOf, single_loop_gains

_NOTCH_DAMPING = 0.5  # of its poles: wide enough for a mode that lies 10 % elsewhere
# Of the lines beside a lowest gain, so that its frequency is known to 1/500 of a step.
_LINE_REFINEMENTS, _PARTS_OF_REFINEMENT = 3, 17
_ROUNDING_OF_GAIN = 1e-9  # relative


def forbidden_gains(gains: Complex, modulus: float) -> tuple[Real, Real]:
    """Return the ends of the gains g with |1 + g L| < m at each line; infinite without any.

    Args:
        gains: L; (n_freq,).
        modulus: m, from 0 to 1.

    Returns:
        (n_freq,) each.
    """
    square = np.maximum(np.abs(gains) ** 2, np.finfo(float).tiny)
    root = gains.real**2 - square * (1 - modulus**2)
    is_met = (root > 0) & (gains.real < 0)
    width = np.sqrt(np.where(is_met, root, 0.0))
    low, high = (-gains.real - width) / square, (-gains.real + width) / square
    return np.where(is_met, low, np.inf), np.where(is_met, high, np.inf)


def allowed_gains(gains: Complex, modulus: float, start: float) -> Real:
    """Return the largest gain that each line allows; (n_freq,).

    Args:
        gains (n_freq,), modulus: as for ``forbidden_gains``.
        start: gain from which it rises. Where lines forbid it, it first falls until none does.
    """
    low, high = forbidden_gains(gains, modulus)
    lowered = start
    while (is_inside := (low < lowered * (1 - _ROUNDING_OF_GAIN)) & (high > lowered)).any():
        lowered = float(low[is_inside].min())
    return np.where((high <= lowered) | (low < lowered * (1 - _ROUNDING_OF_GAIN)), np.inf, low)


def crossover_of(freq_hz: Real, gains: Complex, gain: float) -> float:
    """Return the frequency above which |g L| stays below one [Hz]; NaN if it never reaches one."""
    size = np.log(np.maximum(gain * np.abs(gains), np.finfo(float).tiny))
    above = np.flatnonzero(size > 0)
    if not len(above) or above[-1] == len(size) - 1:
        return float("nan")
    k = above[-1]
    place = size[k] / (size[k] - size[k + 1])
    return float(freq_hz[k] * (freq_hz[k + 1] / freq_hz[k]) ** place)


def notch_response(freq_hz: Real, place_hz: float, ratio: float) -> Complex:
    """Return the notch of the module at each line; (n_freq,).

    Args:
        freq_hz: [Hz]; (n_freq,).
        place_hz: its frequency [Hz].
        ratio: d, its value there.
    """
    turn = 1j * freq_hz / place_hz
    slope = 2 * _NOTCH_DAMPING * turn
    return np.asarray((turn**2 + ratio * slope + 1) / (turn**2 + slope + 1))


def refine_lines(
    gain_of: LoopGainOf, freq: Real, gains: Complex, modulus: float
) -> tuple[Real, Complex]:
    """Return further lines, and GK, where the forbidden gains of a loop begin lowest."""
    for _ in range(_LINE_REFINEMENTS):
        lows = np.stack(
            [forbidden_gains(each, modulus)[0] for each in single_loop_gains(gains).T], axis=-1
        )[1:-1]
        before = np.vstack([np.full(lows.shape[1], np.inf), lows[:-1]])
        after = np.vstack([lows[1:], np.full(lows.shape[1], np.inf)])
        is_lowest = (np.isfinite(lows) & (lows <= before) & (lows <= after)).any(axis=1)
        places = np.flatnonzero(is_lowest) + 1
        parts = [np.geomspace(freq[k - 1], freq[k + 1], _PARTS_OF_REFINEMENT) for k in places]
        between = np.setdiff1d(np.concatenate([np.zeros(0), *parts]), freq)
        if not len(between):
            break
        order = np.argsort(np.append(freq, between), kind="stable")
        freq = np.append(freq, between)[order]
        gains = np.concatenate([gains, gain_of(between)])[order]
    return freq, gains
