r"""How well a measured shape is a simulated one: signed, all channels at once, none privileged.

A measured shape f (real after its phase is taken off, n channels) of a mode that the simulation
has as p is f = c p + e, with any factor c. Its error e has the measurement's variance v and that of
a model whose structure differs: a part eps of the shape's size. With size s^2 = f' f,

    f ~ N(0, s^2 p p' / p' p + V),   V = diag(v) + eps^2 s^2 / n

against f ~ N(0, s^2 / n + V) of a shape that the simulation does not have: the odds are the ratio
of both densities, to the power n_eff / n, for errors of neighbouring places are alike, times that
of the frequencies: log(measured / simulated) ~ N(0, spread^2) against anywhere in the band.
"""

from dataclasses import dataclass

import numpy as np

from identification.matching.modes import ImpactModes
from identification.words import Real


@dataclass(frozen=True)
class Beliefs:
    """What is believed before a test.

    Args:
        shape_error: eps, of the shape's size.
        frequency_error: standard deviation of log(measured / simulated).
        independent: n_eff, at most.
        none: probability that a measured mode is none of the simulated.
    """

    shape_error: float = 0.35
    frequency_error: float = 0.15
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
        at: simulated modes at the channels, signed; (n_simulated, n_channel).
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
    shapes = zip(measured.frequencies, measured.shapes, measured.variance, strict=True)
    for m, (frequency, shape, noise) in enumerate(shapes):
        count, size = len(shape), float(shape @ shape)
        base = noise + beliefs.shape_error**2 * size / count
        power = min(beliefs.independent, count) / count
        none = _density(shape, base + size / count, None)
        for a, other in enumerate(at):
            away = np.log(frequency / simulated_hz[a]) / beliefs.frequency_error
            nearer = -0.5 * away**2 - np.log(np.sqrt(2 * np.pi) * beliefs.frequency_error / width)
            along = other * np.sqrt(size / max(float(other @ other), 1e-300))
            better = power * (_density(shape, base, along) - none)
            found[m, a] = share * np.exp(min(better + nearer, 600.0))
    return found


def _density(shape: Real, diagonal: Real, along: Real | None) -> float:
    """Log density of N(0, diag + along along'), constants of both left out."""
    square = float(np.sum(shape**2 / diagonal))
    logarithm = float(np.log(diagonal).sum())
    if along is not None:
        inside = 1 + float(np.sum(along**2 / diagonal))
        square -= float(np.sum(along * shape / diagonal)) ** 2 / inside
        logarithm += float(np.log(inside))
    return -0.5 * (square + logarithm)
