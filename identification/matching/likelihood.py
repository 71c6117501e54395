"""Likelihood that a measured shape is a simulated one: signed, all channels at once.

No channel is the reference. Let f be a measured shape (real after its phase is removed, n channels)
of a mode that the simulation has as p_a. It is modelled as f = c (p_a + sum_b m_ab p_b) + e, with
any factor ``c``. The real structure differs from the nominal one by dK, relative. To first order
its mode holds m_ab = dK_ab / (ln w_a^2 - ln w_b^2) of mode b. Two modes at one frequency can mix in
any way. With dK_ab ~ N(0, coupling^2) that is

    m_ab^2 = 1/2 (2 coupling)^2 / ((2 coupling)^2 + (ln w_a^2 / w_b^2)^2)

in the mean. The error e has the variance v of the measurement and a model discrepancy: a part eps
of the shape's size. With size s^2 = f' f,

    f ~ N(0, s^2 P P' / tr P'P + V),   P = [p_a, m_ab p_b ..],   V = diag(v) + eps^2 s^2 / n

against f ~ N(0, s^2 / n + V) for a shape that the simulation does not have. The odds are the ratio
of both densities, to the power n_eff / n, since errors of neighbouring places are correlated. They
are multiplied by the odds of the frequencies: log(measured / simulated) ~ N(0, spread^2) against
anywhere in the band.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.words import Real


class MeasuredShapes(Protocol):
    """Measured modes whose shapes are matched, such as ``ImpactModes``."""

    @property
    def frequencies(self) -> Real:
        """Natural frequencies [Hz]; (n_mode,)."""

    @property
    def shapes(self) -> Real:
        """Real shapes of unit size; (n_mode, n_channel)."""

    @property
    def variance(self) -> Real:
        """Variance of their values; (n_mode, n_channel)."""


@dataclass(frozen=True)
class MatchingPriors:
    """Prior assumptions of a match.

    Args:
        shape_error: eps, relative to the shape's size.
        frequency_error: standard deviation of log(measured / simulated).
        coupling: standard deviation of dK_ab.
        independent_channels: n_eff, at most.
        no_match: probability that a measured mode is none of the simulated.
    """

    shape_error: float = 0.45
    frequency_error: float = 0.15
    coupling: float = 0.005
    independent_channels: float = 8.0
    no_match: float = 0.2


def pairing_odds(
    measured: MeasuredShapes,
    simulated: Real,
    simulated_hz: Real,
    band: tuple[float, float],
    priors: MatchingPriors | None = None,
) -> Real:
    """Compute the odds of each pair against no match.

    Args:
        measured: measured modes.
        simulated: simulated modes at the channels, signed, in one normalisation by mass;
            (n_simulated, n_channel).
        simulated_hz: (n_simulated,) [Hz].
        band: band in which modes were identified [Hz].
        priors: prior assumptions.

    Returns:
        W; (n_measured, n_simulated).
    """
    priors = priors or MatchingPriors()
    table = np.zeros((len(measured.shapes), len(simulated)))
    width = np.log(band[1] / band[0])
    prior_odds = (1 - priors.no_match) / priors.no_match
    mixed = mixing(simulated_hz, priors.coupling)
    shapes = zip(measured.frequencies, measured.shapes, measured.variance, strict=True)
    for m, (frequency, shape, noise) in enumerate(shapes):
        count, size = len(shape), float(shape @ shape)
        base = noise + priors.shape_error**2 * size / count
        power = min(priors.independent_channels, count) / count
        log_none = _log_density(shape, base + size / count, np.zeros((count, 0)))
        for a in range(len(simulated)):
            mismatch = np.log(frequency / simulated_hz[a]) / priors.frequency_error
            log_frequency = -0.5 * mismatch**2 - np.log(
                np.sqrt(2 * np.pi) * priors.frequency_error / width
            )
            # The mode with its parts of all others, scaled to the size of the measured shape.
            mixture = mixed[a][:, None] * simulated
            unit = np.sqrt(size / max(float((mixture**2).sum()), 1e-300))
            log_shape = power * (_log_density(shape, base, unit * mixture.T) - log_none)
            table[m, a] = prior_odds * np.exp(min(log_shape + log_frequency, 600.0))
    return table


def mixing(simulated_hz: Real, coupling: float) -> Real:
    """Compute how much of each other mode a mode of the real structure holds (standard deviation).

    Args:
        simulated_hz: (n_simulated,) [Hz].
        coupling: relative; see above.

    Returns:
        m, 1 on the diagonal; (n_simulated, n_simulated).
    """
    logarithm = 2 * np.log(np.maximum(simulated_hz, 1e-300))
    difference = logarithm[:, None] - logarithm
    square = 0.5 * (2 * coupling) ** 2 / np.maximum((2 * coupling) ** 2 + difference**2, 1e-300)
    np.fill_diagonal(square, 1.0)
    return np.sqrt(square)


def _log_density(shape: Real, diagonal: Real, along: Real) -> float:
    """Return the log density of N(0, diag + along along'), without constants; along (n_channel, n).

    Inverse and determinant follow from the Woodbury identity.
    """
    whitened = along / np.sqrt(diagonal)[:, None]
    unit = shape / np.sqrt(diagonal)
    capacitance = np.eye(whitened.shape[1]) + whitened.T @ whitened
    projected = whitened.T @ unit
    square = float(unit @ unit - projected @ np.linalg.solve(capacitance, projected))
    logarithm = float(np.log(diagonal).sum() + np.linalg.slogdet(capacitance)[1])
    return -0.5 * (square + logarithm)
