"""Order of a reduced state space: the smallest whose error nobody can see.

With bands, states below the interval are worthless: the error of the reduction is at most a third
of the half width of the 95 % interval at every line of the band, which widens the interval by 5 %
if both add in squares. Without bands it is at most 1e-3 of the largest FRF of each pair by its
bound, at every frequency.
"""

import numpy as np

from identification.words import Complex, Real
from mbmodel.reduction.truncation import ReducedSystem, Reduction

_MAX_INTERVAL_SHARE = 1 / 3  # of the half width
_MAX_PEAK_SHARE = 1e-3  # of the largest FRF, where no interval is known


def reduce_within_interval(
    reduction: Reduction, freq_hz: Real, values: Complex, half_width: Real
) -> ReducedSystem:
    """Return the system of fewest states whose error is a third of the interval's half width.

    Args:
        reduction: truncation at any order.
        freq_hz: lines [Hz]; (n_freq,).
        values: FRFs of the whole system; (n_freq, n_out, n_in).
        half_width: of the 95 % interval of the magnitudes; (n_freq, n_out, n_in).
    """
    moving = freq_hz > 0
    laplace = np.asarray(2j * np.pi * freq_hz[moving], complex)
    allowed = _MAX_INTERVAL_SHARE * half_width[moving]

    def is_hidden(candidate: ReducedSystem) -> bool:
        return bool((np.abs(candidate.system.at(laplace) - values[moving]) <= allowed).all())

    return reduction.smallest(is_hidden)


def reduce_by_bound(reduction: Reduction) -> ReducedSystem:
    """Return the system of fewest states whose bound is 1e-3 of the largest FRFs."""
    return reduction.smallest(lambda candidate: candidate.scaled_bound <= _MAX_PEAK_SHARE)
