"""Sums of products of channels from which delays of the channels are removed.

With y = exp(i w tau) z the readings without their delays and d = tau_k - tau_l, a fit needs

    G = sum Re(y_k y_l*),   W1 = sum w Im(y_k y_l*),   W2 = sum w^2 Re(y_k y_l*):

the residual's power is tr(P G), dG_kl / dtau_m = -(delta_km - delta_lm) W1_kl, and a delay has the
information P_kl W2_kl. In a band of lines about w_b, y_k y_l* = exp(i w_b d) sum_n (i d)^n / n!
(w - w_b)^n z_k z_l*. So three sums of each band hold all that a delay may ask, if the phase
(w - w_b) d stays well below one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.words import Complex, Integers, Mask, Real


@dataclass(frozen=True, eq=False)
class DelayedSums:
    """Sums over bands of lines, per group of columns with equal channels.

    Args:
        centre: w_b of each band [rad/s]; (n_block,).
        sums: sum (w - w_b)^n z z^H; (3, n_group, n_block, n_channel, n_channel).
    """

    centre: Real
    sums: Complex

    def select_blocks(self, blocks: Mask | slice) -> "DelayedSums":
        """Return the sums of some bands."""
        return DelayedSums(self.centre[blocks], self.sums[:, :, blocks])

    def power(self, delays: Real) -> Real:
        """Compute G without these delays; (n_group, n_block, n, n).

        Args:
            delays: tau [s]; (n_channel,).
        """
        difference = 1j * (delays[:, None] - delays)
        turn = np.exp(self.centre[:, None, None] * difference)
        zeroth, first, second = self.sums
        return np.asarray((turn * (zeroth + difference * (first + 0.5 * difference * second))).real)

    def remove(self, delays: Real) -> tuple[Real, Real, Real]:
        """Compute G, W1 and W2 without these delays; each (n_group, n_block, n, n).

        Args:
            delays: tau [s]; (n_channel,).
        """
        difference = delays[:, None] - delays
        centre = self.centre[:, None, None]
        turn = np.exp(1j * centre * difference)
        zeroth, first, second = self.sums
        shifted = 1j * difference * second
        product = turn * (zeroth + 1j * difference * (first + 0.5 * shifted))
        weighted = turn * (first + shifted)
        return (
            product.real,
            (centre * product + weighted).imag,
            (centre**2 * product + 2 * centre * weighted + turn * second).real,
        )


def band_sums(
    freq_hz: Real, white: Complex, groups: Sequence[Mask], starts: Integers
) -> DelayedSums:
    """Sum the products of channels and their first two moments about the centre of each band.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        white: z; (n_column, n_freq, n_channel).
        groups: columns of each group; n_group of (n_column,).
        starts: first lines of all bands and the end of the last; (n_block + 1,).
    """
    omega = 2 * np.pi * freq_hz
    bands = [slice(*edges) for edges in pairwise(starts)]
    centre = np.array([omega[band].mean() for band in bands])
    count = white.shape[2]
    sums = np.zeros((3, len(groups), len(bands), count, count), complex)
    for g, columns in enumerate(groups):
        for b, band in enumerate(bands):
            z = white[columns, band].reshape(-1, count)
            offset = np.tile(omega[band] - centre[b], int(columns.sum()))[:, None]
            for power in range(3):
                sums[power, g, b] = (z * offset**power).T @ z.conj()
    return DelayedSums(centre, sums)
