"""Sums over lines and hits of products of a body's channels: all that a fit of its errors needs.

Sums of products of channels from which delays of the channels are removed.

With y = exp(i w tau) z the readings without their delays and d = tau_k - tau_l, a fit needs

    G = sum Re(y_k y_l*),   W1 = sum w Im(y_k y_l*),   W2 = sum w^2 Re(y_k y_l*):

the residual's power is tr(P G), dG_kl / dtau_m = -(delta_km - delta_lm) W1_kl, and a delay has the
information P_kl W2_kl. In a band of lines about w_b, y_k y_l* = exp(i w_b d) sum_n (i d)^n / n!
(w - w_b)^n z_k z_l*. So three sums of each band hold all that a delay may ask, if the phase
(w - w_b) d stays well below one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from identification.solid.body_channels import BodyData
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


N_BLOCKS = 24  # blocks of lines of the cross-validation


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over lines and hits, per group of columns with equal channels and per block of lines.

    Args:
        mask: channels of each group; (n_group, n_channel).
        gram: sum Re(z z^H); (n_group, n_block, n_channel, n_channel).
        noise: its diagonal due to noise alone; (n_group, n_block, n_channel).
        count: number of values summed; (n_group, n_block).
        delayed: sums from which delays can be removed, in which case blocks stay apart; None if
            delays are no errors.
    """

    mask: Mask
    gram: Real
    noise: Real
    count: Real
    delayed: DelayedSums | None = None

    @classmethod
    def of(
        cls,
        data: BodyData,
        reading: Complex | None = None,
        *,
        blocks: int = N_BLOCKS,
        every: int = 1,
    ) -> "Moments":
        """Sum the data of a body, divided by the readings of its channels per motion.

        Args:
            reading: H of each channel, 1 for a healthy one; (n_freq, n_channel).
            blocks: number of blocks of lines.
            every: use every so many-th line only, for a screening.
        """
        patterns, group = np.unique(data.measured, axis=0, return_inverse=True)
        white, noise = data.white[:, ::every], data.noise[:, ::every]
        if reading is not None:
            white, noise = white / reading[::every], noise / np.abs(reading[::every]) ** 2
        has_delays = data.sensors.has_delays
        starts = block_edges(white.shape[1], N_BLOCKS if has_delays else blocks)
        shape = (len(patterns), len(starts) - 1)
        total, count = np.zeros((*shape, white.shape[2])), np.zeros(shape)
        np.add.at(total, np.ravel(group), np.add.reduceat(noise, starts[:-1], axis=1))
        used = (white != 0).any(axis=2)
        np.add.at(count, np.ravel(group), np.add.reduceat(used.astype(float), starts[:-1], axis=1))
        keep = patterns.any(axis=1)
        groups = [np.ravel(group) == g for g in np.flatnonzero(keep)]
        if has_delays:
            delayed = band_sums(data.freq_hz[::every], white, groups, starts)
            gram = np.ascontiguousarray(delayed.sums[0].real)
            return cls(patterns[keep], gram, total[keep], count[keep], delayed)
        gram = np.zeros((len(groups), shape[1], white.shape[2], white.shape[2]))
        for g, columns in enumerate(groups):
            for b, (first, last) in enumerate(pairwise(starts)):
                z = white[columns, first:last].reshape(-1, white.shape[2])
                gram[g, b] = z.real.T @ z.real + z.imag.T @ z.imag
        return cls(patterns[keep], gram, total[keep], count[keep])

    def exchange_channels(self, order: Sequence[int], signs: Real) -> "Moments":
        """Return the sums in which channel k has the readings of channel ``order[k]``.

        Args:
            order: number of the channel whose readings each channel gets; n_channel.
            signs: factor of each channel, 1 or -1; (n_channel,).
        """
        pairs, factor = np.ix_(order, order), np.outer(signs, signs)
        delayed = self.delayed
        if delayed is not None:
            delayed = replace(delayed, sums=delayed.sums[..., pairs[0], pairs[1]] * factor)
        return Moments(
            self.mask[:, order],
            self.gram[..., pairs[0], pairs[1]] * factor,
            self.noise[..., order],
            self.count,
            delayed,
        )

    def select_blocks(self, blocks: Mask | slice) -> "Moments":
        """Return the sums of some blocks."""
        return Moments(
            self.mask,
            self.gram[:, blocks],
            self.noise[:, blocks],
            self.count[:, blocks],
            None if self.delayed is None else self.delayed.select_blocks(blocks),
        )

    def sum_blocks(self, blocks: Mask | slice) -> "Moments":
        """Return the sum of some blocks as one block, or side by side if delays are errors."""
        if self.delayed is not None:
            return self.select_blocks(blocks)
        return Moments(
            self.mask,
            self.gram[:, blocks].sum(axis=1, keepdims=True),
            self.noise[:, blocks].sum(axis=1, keepdims=True),
            self.count[:, blocks].sum(axis=1, keepdims=True),
        )

    def without_delays(self, delays: Real | None) -> "Moments":
        """Return the sums of readings without these delays [s]; None: delays are no errors."""
        if self.delayed is None or delays is None:
            return self
        return replace(self, gram=self.delayed.power(delays))

    def fit_sums(self) -> "FitSums":
        """Return what a fit of all blocks needs."""
        return FitSums(self.mask, self.gram.sum(axis=1), self.noise.sum(axis=1), self.delayed)


@dataclass(frozen=True, eq=False)
class FitSums:
    """Sums over all blocks, per group of columns with equal channels.

    Args:
        mask: channels of each group; (n_group, n_channel).
        gram: sum Re(z z^H); (n_group, n_channel, n_channel).
        noise: its diagonal due to noise alone; (n_group, n_channel).
        delayed: sums from which delays can be removed; None if delays are no errors.
    """

    mask: Mask
    gram: Real
    noise: Real
    delayed: DelayedSums | None

    def clean(self, delays: Real | None) -> Real:
        """Return G - V of each group without these delays [s]; (n_group, n_channel, n_channel)."""
        if self.delayed is None or delays is None:
            clean = self.gram.copy()
        else:
            clean = self.delayed.total_power(delays)
        places = np.arange(clean.shape[1])
        clean[:, places, places] -= self.noise
        return clean

    def delay_sums(self, delays: Real | None) -> tuple[Real, Real] | None:
        """Return W1 and W2, each (n_group, n_channel, n_channel); None: delays are no errors."""
        if self.delayed is None or delays is None:
            return None
        return self.delayed.total_slopes(delays)


def block_edges(lines: int, blocks: int = N_BLOCKS) -> Integers:
    """Return the first lines of all blocks and the end of the last; (n_block + 1,)."""
    return np.linspace(0, lines, min(blocks, lines) + 1).astype(np.intp)
