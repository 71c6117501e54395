"""Frequency lines for integrals over resonances, with their weights.

A resonance at f_n with damping ratio z has the half width z f_n. Lines at
``f_n (1 + z tan(u))``, evenly spaced in u, share its integral evenly, however sharp it is.
"""

import numpy as np

from identification.words import Complex, Real

_LINES_PER_DECADE = 200  # between resonances: a density bends little within 1 %
_LINES_PER_RESONANCE = 160  # an even share errs by a part of 1e-4
_WIDEST_ANGLE = 1.53  # of u: 24 half widths away, where the other lines take over
_MIN_RESOLVED_DAMPING = 1e-7  # of a resonance with lines of its own: those below have no finite rms


def integration_lines(band: tuple[float, float], poles: Complex, edges: Real) -> Real:
    """Return frequency lines that resolve resonances and the edges of spectra; (n_freq,).

    Args:
        band: lowest and highest frequency [Hz].
        poles: of the machine with its loops [rad/s]; (n_pole,).
        edges: lines of the spectra [Hz]; (n_edge,). A density may jump at each.
    """
    low, high = band
    count = int(np.ceil(_LINES_PER_DECADE * np.log10(high / low))) + 2
    angles = np.tan(np.linspace(-_WIDEST_ANGLE, _WIDEST_ANGLE, _LINES_PER_RESONANCE))
    oscillating = poles[poles.imag > 0]
    natural = np.abs(oscillating.imag) / (2 * np.pi)
    half_width = np.maximum(np.abs(oscillating.real) / (2 * np.pi), _MIN_RESOLVED_DAMPING * natural)
    near = (natural[:, None] + half_width[:, None] * angles).ravel()
    lines = np.concatenate(
        [np.geomspace(low, high, count), near, edges * (1 - 1e-9), edges, edges * (1 + 1e-9)]
    )
    inside: Real = np.unique(np.append(lines[(lines > low) & (lines < high)], band))
    return inside


def trapezoid_weights(freq_hz: Real) -> Real:
    """Return the weights of the trapezoidal rule [Hz]; (n_freq,)."""
    steps = np.diff(freq_hz)
    weights: Real = (np.append(steps, 0.0) + np.append(0.0, steps)) / 2
    return weights
