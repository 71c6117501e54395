"""Blocks of frequency lines that are held out together: from resonance to resonance.

A block that holds a whole narrow mode asks for what no other line tells: where that mode lies. The
answer is wrong by many times the noise for right models and wrong ones alike. So a block ends at
the peak of each measured resonance: one flank of a mode then stands in the next fold, and what a
fit foretells is the other flank, and all that lies between two modes.

The blocks are those of the measurement, whatever is fitted: one scheme for all models of a
campaign.
"""

from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d

from identification.words import Campaign, Integers

N_FOLDS = 5
MIN_BLOCK_LINES = 8  # any shape along frequency fits fewer
_BANDWIDTHS = 10  # of a block at most: further away, neighbours tell nothing of a resonance
_MIN_BLOCKS = 15  # three for each fold, so that no fold is all of one range
_HALF_POWER = 0.5  # by which a mode stands out
_NOISE_SIGMA = 4.5  # and from the noise: of 10,000 lines none does by chance
_ONE_MODE_LINES = 5  # within which channels show the peak of one and the same mode


def find_blocks(campaign: Campaign) -> Integers:
    """Return the first line of each block, in ascending order; (n_block,).

    Blocks begin at the peaks of the channels. Between them they are at most ten lower quartiles of
    the peaks' half-power bandwidths wide, and at most a fifteenth of the band, but no narrower than
    8 lines.

    Args:
        campaign: tests on the lines of the band.
    """
    peaks, bandwidth = _find_peaks(campaign)
    n_freq = len(campaign.freq_hz)
    width = max(min(n_freq // _MIN_BLOCKS, round(_BANDWIDTHS * bandwidth)), MIN_BLOCK_LINES)
    starts = [
        start
        for low, high in pairwise([0, *peaks.tolist(), n_freq])
        for start in np.linspace(low, high, _count_blocks(high - low, width), endpoint=False)
    ]
    return np.unique(np.round(starts).astype(np.intp))


def assign_folds(starts: Integers, n_freq: int) -> Integers:
    """Return the fold of each line, with block i in fold i mod 5; (n_freq,)."""
    folds: Integers = (np.searchsorted(starts, np.arange(n_freq), side="right") - 1) % N_FOLDS
    return folds


def _count_blocks(lines: int, width: int) -> int:
    """Return the number of blocks of some lines, each as wide as allowed, or narrower."""
    return max(1, min(-(-lines // width), lines // MIN_BLOCK_LINES))


def _find_peaks(campaign: Campaign) -> tuple[Integers, float]:
    """Return the lines at which channels have peaks, and the lower quartile of their width [lines].

    In each channel a peak exceeds its surroundings by half its power, and by 4.5 standard
    deviations of the noise. Peaks of several channels within 5 lines are those of one mode. The
    width is that of the whole band if there is no peak.
    """
    from scipy.signal import find_peaks, peak_widths  # noqa: PLC0415  # slow to load

    n_freq = len(campaign.freq_hz)
    count, widths = np.zeros(n_freq), []
    for test in campaign.tests:
        measured = test.estimate.measured[:, 0]
        values = test.estimate.frf.values[:, measured, 0]
        for value, variance in zip(values.T, test.estimate.variance[:, measured, 0].T, strict=True):
            power = np.abs(value) ** 2
            noise = np.sqrt((2 * power + variance) * variance)  # of |H + n|^2, n circular
            prominence = np.maximum(_HALF_POWER * power, _NOISE_SIGMA * noise)
            peaks, _ = find_peaks(power, prominence=prominence)
            count[peaks] += 1
            widths.append(peak_widths(power, peaks, rel_height=_HALF_POWER)[0])
    seen = uniform_filter1d(count, _ONE_MODE_LINES, mode="constant")
    modes, _ = find_peaks(seen, distance=_ONE_MODE_LINES, prominence=_HALF_POWER * seen)
    all_widths = np.concatenate(widths) if widths else np.zeros(0)
    return modes, float(np.quantile(all_widths, 0.25)) if len(all_widths) else float(n_freq)
