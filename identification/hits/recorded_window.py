"""Exponential windows that the analyser applied before it stored the records.

The noise of a force sensor does not change within a block. Under a window exp(-t / tau) it falls
with 1 / tau, long after the pulse. The responses cannot show a window, since they decay too.
"""

import numpy as np

from identification.hits.blocks import Blocks
from identification.words import Real

_N_NOISE_CHUNKS = 12  # chunks of the force after the pulse, whose noise is compared
_MIN_CHUNK_SAMPLES = 24  # samples of a chunk: its rms then scatters by some 10 %
_REACH_WIDTHS = 6  # pulse widths after the pulse that are left out: the hammer rings
_MIN_REACH_SAMPLES = 48  # samples left out at least: anti-aliasing filters ring
_MIN_DECAY_NEPERS = 1.0  # fall of the noise over the block: less can be chance
_MAX_SCATTER_NEPERS = 0.35  # scatter of the logarithms about a straight line


def combine_windows(*taus: float) -> float:
    """Return the time constant of several exponential windows together [s]; 0 for none.

    exp(-t / a) exp(-t / b) = exp(-t (1 / a + 1 / b)).
    """
    decay = sum(1.0 / tau for tau in taus if tau > 0)
    return 1.0 / decay if decay else 0.0


def detect_recorded_window(blocks: Blocks) -> float | None:
    """Estimate the exponential window that the records carry, from the noise of the force.

    The rms of third differences of the force, which offsets and slow drift do not reach, is taken
    in chunks after the pulse, and a straight line is fitted to its logarithm.

    Args:
        blocks: blocks of the hits, before any window of this software.

    Returns:
        Time constant [s]; None where the noise is steady or there is none.
    """
    ends = [
        blow.end - start + max(_REACH_WIDTHS * blow.main.width, _MIN_REACH_SAMPLES)
        for blow, start in zip(blocks.blows, blocks.starts, strict=True)
    ]
    first = max(ends)
    length = (blocks.plan.block - first - 3) // _N_NOISE_CHUNKS
    if length < _MIN_CHUNK_SAMPLES:
        return None
    differences = np.diff(blocks.force[:, first:], 3, axis=1)[:, : _N_NOISE_CHUNKS * length]
    chunks = differences.reshape(len(ends), _N_NOISE_CHUNKS, length)
    power: Real = (chunks**2).mean(axis=(0, 2))
    if not (power > 0).all():
        return None
    log_rms = np.log(power) / 2
    time = np.arange(_N_NOISE_CHUNKS) * length / blocks.records.rate_hz
    slope, level = np.polyfit(time, log_rms, 1)
    scatter = float(np.std(log_rms - slope * time - level))
    is_window = -slope * time[-1] > _MIN_DECAY_NEPERS and scatter < _MAX_SCATTER_NEPERS
    return float(-1.0 / slope) if is_window else None
