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
        zeroth, first, second = self.sums
        series = zeroth + difference * (first + 0.5 * difference * second)
        return np.asarray((self._turn(delays) * series).real)

    def total_power(self, delays: Real) -> Real:
        """Compute the sum of ``power`` over all blocks; (n_group, n, n)."""
        difference = 1j * (delays[:, None] - delays)
        zeroth, first, second = (self._turn(delays) * self.sums).sum(axis=2)
        return np.asarray((zeroth + difference * (first + 0.5 * difference * second)).real)

    def total_slopes(self, delays: Real) -> tuple[Real, Real]:
        """Compute W1 and W2 without these delays, summed over all blocks; each (n_group, n, n).

        Args:
            delays: tau [s]; (n_channel,).
        """
        difference = 1j * (delays[:, None] - delays)
        weights = self.centre ** np.arange(3)[:, None]
        moments = np.moveaxis(self._turn(delays) * self.sums, 2, 0)
        # Sums with each power of w_b of each moment, real and imaginary parts at once.
        rows = np.ascontiguousarray(moments.reshape(len(self.centre), -1))  # a view needs that
        flat = weights @ rows.view(float)
        weighted = flat.view(complex).reshape(3, *moments.shape[1:])

        def product(power: int) -> Complex:
            total, by_offset, by_square = weighted[power]
            return np.asarray(total + difference * (by_offset + 0.5 * difference * by_square))

        def product_by_offset(power: int) -> Complex:
            return np.asarray(weighted[power][1] + difference * weighted[power][2])

        return (
            (product(1) + product_by_offset(0)).imag,
            (product(2) + 2 * product_by_offset(1) + weighted[0][2]).real,
        )

    def _turn(self, delays: Real) -> Complex:
        """Return exp(i w_b (tau_k - tau_l)) of each pair of channels; (n_block, n, n)."""
        turns = np.exp(1j * self.centre[:, None] * delays)
        return np.asarray(turns[:, :, None] * turns[:, None].conj())


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
