r"""How well a measured shape is a simulated one: signed, all channels at once, none privileged.

A measured shape f (real after its phase is taken off, n channels) of a mode that the simulation
has as p_a is f = c (p_a + sum_b m_ab p_b) + e, with any factor c: of a structure that differs from
the drawing by dK, relative, a mode holds others by the first order m_ab = dK_ab / (ln w_a^2 - ln
w_b^2), and of two at one frequency any mixture. With dK_ab ~ N(0, coupling^2) that is

    m_ab^2 = 1/2 (2 coupling)^2 / ((2 coupling)^2 + (ln w_a^2 / w_b^2)^2)

in the mean. The error e has the measurement's variance v and what is left of the other structure: a
part eps of the shape's size. With size s^2 = f' f,

    f ~ N(0, s^2 P P' / tr P'P + V),   P = [p_a, m_ab p_b ..],   V = diag(v) + eps^2 s^2 / n

against f ~ N(0, s^2 / n + V) of a shape that the simulation does not have: the odds are the ratio
of both densities, to the power n_eff / n, for errors of neighbouring places are alike, times that
of the frequencies: log(measured / simulated) ~ N(0, spread^2) against anywhere in the band.
"""

from dataclasses import dataclass

import numpy as np

from identification.matching.measured_modes import ImpactModes
from identification.words import Real


@dataclass(frozen=True)
class Beliefs:
    """What is believed before a test.

    Args:
        shape_error: eps, of the shape's size.
        frequency_error: standard deviation of log(measured / simulated).
        coupling: standard deviation of dK_ab.
        independent: n_eff, at most.
        none: probability that a measured mode is none of the simulated.
    """

    shape_error: float = 0.45
    frequency_error: float = 0.15
    coupling: float = 0.005
    independent: float = 8.0
    none: float = 0.2


def odds(
    measured: ImpactModes,
    at: Real,
    simulated_hz: Real,
    band: tuple[float, float],
    beliefs: Beliefs | None = None,
) -> Real:
    """Odds of each pair against no match.

    Args:
        measured: modes.
        at: simulated modes at the channels, signed, in one normalisation by mass; (n_simulated,
            n_channel).
        simulated_hz: (n_simulated,).
        band: in which measured modes were looked for [Hz].
        beliefs: before the test.

    Returns:
        W; (n_measured, n_simulated).
    """
    beliefs = beliefs or Beliefs()
    found = np.zeros((len(measured.shapes), len(at)))
    width = np.log(band[1] / band[0])
    share = (1 - beliefs.none) / beliefs.none
    mixed = mixing(simulated_hz, beliefs.coupling)
    shapes = zip(measured.frequencies, measured.shapes, measured.variance, strict=True)
    for m, (frequency, shape, noise) in enumerate(shapes):
        count, size = len(shape), float(shape @ shape)
        base = noise + beliefs.shape_error**2 * size / count
        power = min(beliefs.independent, count) / count
        none = _density(shape, base + size / count, np.zeros((count, 0)))
        for a in range(len(at)):
            away = np.log(frequency / simulated_hz[a]) / beliefs.frequency_error
            nearer = -0.5 * away**2 - np.log(np.sqrt(2 * np.pi) * beliefs.frequency_error / width)
            # Its share of each other mode, in one normalisation; and as large as what was measured.
            parts = mixed[a][:, None] * at
            unit = np.sqrt(size / max(float((parts**2).sum()), 1e-300))
            better = power * (_density(shape, base, unit * parts.T) - none)
            found[m, a] = share * np.exp(min(better + nearer, 600.0))
    return found


def mixing(simulated_hz: Real, coupling: float) -> Real:
    """How much of each other mode a mode of the real structure holds, standard deviations.

    Args:
        simulated_hz: (n_simulated,).
        coupling: relative; see above.

    Returns:
        m, 1 on the diagonal; (n_simulated, n_simulated).
    """
    logarithm = 2 * np.log(np.maximum(simulated_hz, 1e-300))
    apart = logarithm[:, None] - logarithm
    square = 0.5 * (2 * coupling) ** 2 / np.maximum((2 * coupling) ** 2 + apart**2, 1e-300)
    np.fill_diagonal(square, 1.0)
    found: Real = np.sqrt(square)
    return found


def _density(shape: Real, diagonal: Real, along: Real) -> float:
    """Log density of N(0, diag + along along'), constants left out; along (n_channel, n)."""
    whitened = along / np.sqrt(diagonal)[:, None]
    unit = shape / np.sqrt(diagonal)
    inside = np.eye(whitened.shape[1]) + whitened.T @ whitened
    pulled = whitened.T @ unit
    square = float(unit @ unit - pulled @ np.linalg.solve(inside, pulled))
    logarithm = float(np.log(diagonal).sum() + np.linalg.slogdet(inside)[1])
    return -0.5 * (square + logarithm)
