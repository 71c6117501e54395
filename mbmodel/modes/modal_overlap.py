"""Modal overlap: up to which frequency a test tells single modes apart."""

import numpy as np

from identification.words import Real

_MAX_DAMPING_OF_PEAKS = 0.2


def highest_separate_mode(freq_hz: Real, damping: Real) -> float:
    """Return the highest mode below the frequency from which on modes overlap [Hz]; 0 without any.

    A mode of damping ratio d occupies its half-power bandwidth 2 d f. The modal overlap is the sum
    of these over an octave, over that octave. Where it exceeds one, no test tells single modes
    apart (Lyon and DeJong 1995, sec. 4.2), and a harder tip would only take force from the modes
    below. Modes of 20 % damping and more have no peak, and do not count.

    Args:
        freq_hz: natural frequencies [Hz]; (n_mode,).
        damping: damping ratios; (n_mode,).
    """
    peaks = (damping < _MAX_DAMPING_OF_PEAKS) & (freq_hz > 0)
    order = np.argsort(freq_hz[peaks])
    natural, width = freq_hz[peaks][order], (2 * damping * freq_hz)[peaks][order]
    highest = 0.0
    for frequency in natural.tolist():
        octave = np.array([2**-0.5, 2**0.5]) * frequency
        inside = (natural > octave[0]) & (natural <= octave[1])
        if width[inside].sum() > np.diff(octave)[0]:
            break
        highest = frequency
    return highest
