"""Sums over lines and hits of products of a body's channels: all that a fit of its errors needs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from identification.solid.body_channels import BodyData
from identification.solid.delayed_sums import DelayedSums, band_sums
from identification.words import Complex, Integers, Mask, Real

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
            data: channels of a body.
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
