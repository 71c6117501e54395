r"""Blocks, overlap and window by the kind of a continuous excitation.

Three kinds are told apart by the force alone:

* *periodic*: the force repeats. Blocks are its periods, without a window, which have no leakage
  once the machine has settled: the first period of a record is left out.
* *burst*: the force rests at the end of each record, or before each of several bursts in a record,
  and so does the motion. A block is a record, or a burst with its decay, without a window.
* *random*: everything else. Blocks have Hann windows that overlap by two thirds (Bendat and Piersol
  2010, ch. 11.5).

Overlapping blocks share noise. K blocks of a window w that begin D samples apart count as

    n = K / (1 + 2 sum_j (1 - j / K) rho_j),   rho_j = (sum_t w(t) w(t + j D) / sum_t w(t)^2)^2

independent ones (Welch 1967).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.fft
from scipy.ndimage import uniform_filter1d

from identification.words import InputError, Real, Records

Kind = Literal["periodic", "burst", "random"]

_MIN_REPEATED = 0.98  # correlation of a force with itself a period later
_LEAST_REPEATED = 0.7  # beside noise: half as strong as what repeats
_MAX_LOSS, _MIN_MULTIPLES = 0.05, 3  # of that correlation from one period to all that follow
_MAX_BETWEEN = 0.5  # correlation below which a force has changed before it repeats
_REST_SHARE, _REST_RATIO = 0.05, 0.02  # end of a record, and its rms over that of the record
_BINS, _REST_GAP = 1000, 0.2  # of a record; rest after a burst over the time between bursts
_BEFORE_SHARE = 0.2  # of the record, before its end: where a decay would still be larger
_MAX_END_NOISE, _MIN_STEADY = 0.1, 0.6  # rms of noise over that of the record, and over that before
_BLOCKS = 8  # lengths of a block that a random force lasts: 16 independent blocks, for each input
_MIN_BLOCK = 64  # samples
_HOPS = 3  # hops of a Hann window: an overlap of two thirds
_MIN_REPETITIONS = 2  # of a record, that its force counts as periodic


@dataclass(frozen=True, eq=False)
class ContinuousBlocks:
    """How records are cut.

    Args:
        kind: of the force.
        window: of a block; (n_sample,).
        starts: first sample of each block of a record; n_block.
        count: independent blocks of all records.
    """

    kind: Kind
    window: Real
    starts: tuple[int, ...]
    count: float

    @property
    def length(self) -> int:
        """Samples of a block."""
        return len(self.window)

    def half(self) -> "ContinuousBlocks":
        """Return windows of half the length over the same samples."""
        length, end = self.length // 2, self.starts[-1] + self.length
        hop = max(length // _HOPS, 1)
        starts = tuple(range(self.starts[0], end - length + 1, hop))
        return ContinuousBlocks(self.kind, _hann(length), starts, 2 * self.count)


def plan_continuous_blocks(
    records: Records, block_s: float | None = None, period: int | None = None
) -> ContinuousBlocks:
    """Choose the blocks of records with a continuous force.

    Args:
        records: of one reference; forces that act with it repeat with it.
        block_s: length of a block [s] of a random force; chosen if None.
        period: samples after which the force repeats; None if it does not.

    Raises:
        InputError: blocks are longer than a record, or shorter than 64 samples.
    """
    n_record, n_sample = records.force.shape
    if period is not None:
        starts = tuple(range(0, n_sample - period + 1, period))
        starts = starts[1:] if len(starts) > _MIN_REPETITIONS else starts
        return ContinuousBlocks("periodic", np.ones(period), starts, float(n_record * len(starts)))
    bursts, length = ((0,), n_sample) if n_record > 1 else find_bursts(records.force)
    length -= length % 2
    if block_s is None and n_record * len(bursts) > 1 and _is_at_rest(records, bursts, length):
        return ContinuousBlocks("burst", np.ones(length), bursts, float(n_record * len(bursts)))
    length = round(block_s * records.rate_hz) if block_s is not None else 0
    if not length:
        inputs = 1 + len(records.further_references)
        share = n_record * n_sample // (_BLOCKS * inputs)
        length = scipy.fft.prev_fast_len(max(min(share, n_sample), _MIN_BLOCK))
    length -= length % 4  # half of a block has an even number of samples too
    if not _MIN_BLOCK <= length <= n_sample:
        raise InputError(
            f"{records.test}: blocks of {length} samples do not fit into records of {n_sample}, or "
            f"are shorter than {_MIN_BLOCK}: set block_s, or record longer"
        )
    hop = length // _HOPS
    starts = tuple(range(0, n_sample - length + 1, hop))
    window = _hann(length)
    return ContinuousBlocks(
        "random", window, starts, n_record * _independent_blocks(window, hop, starts)
    )


def find_period(force: Real) -> int | None:
    """Return the number of samples after which a force repeats, None if it does not.

    The correlation of a record with itself, P samples later, over the energy of both parts, is one
    at a period. It has to fall before, which a slow force does not do at once. Beside noise, as in
    the command of a loop, it is less, but the same at all multiples of the period. That of a sharp
    resonance falls from one to the next.

    Args:
        force: one input; (n_record, n_sample).
    """
    part = force - force.mean(axis=1, keepdims=True)
    n_sample = part.shape[1]
    spectrum = scipy.fft.rfft(part, 2 * n_sample)
    lagged = scipy.fft.irfft(np.abs(spectrum) ** 2)[:, : n_sample // _MIN_REPETITIONS + 1].sum(
        axis=0
    )
    energy = np.cumsum(part**2, axis=1)
    lags = np.arange(len(lagged))
    head = energy[:, n_sample - 1 - lags].sum(axis=0)
    tail = (energy[:, -1:] - np.pad(energy, ((0, 0), (1, 0)))[:, lags]).sum(axis=0)
    product = np.sqrt(head * tail)
    correlation = np.divide(lagged, product, out=np.zeros_like(lagged), where=product > 0)
    changed = np.flatnonzero(correlation < _MAX_BETWEEN)
    if not changed.size:
        return None
    repeated = changed[0] + np.flatnonzero(correlation[changed[0] :] > _MIN_REPEATED)
    if not repeated.size:
        return _find_noisy_period(correlation, int(changed[0]))
    # The first run above the bound belongs to one period: its top is the period.
    run = repeated[: 1 + np.flatnonzero(np.diff(np.append(repeated, 2 * n_sample)) > 1)[0]]
    return int(run[np.argmax(correlation[run])])


def _find_noisy_period(correlation: Real, first: int) -> int | None:
    """Return the period of a force that repeats beside noise, None if none keeps its correlation.

    Args:
        correlation: by the lag; (n_lag,).
        first: lag at which it has fallen.
    """
    inner = correlation[1:-1]
    is_top = (inner > _LEAST_REPEATED) & (inner >= correlation[:-2]) & (inner > correlation[2:])
    for period in 1 + np.flatnonzero(is_top):
        multiples = range(period, len(correlation), period)
        if period <= first or len(multiples) < _MIN_MULTIPLES:
            continue
        kept = [correlation[at - k : at + k + 1].max() for k, at in enumerate(multiples, 1)]
        if min(kept) > correlation[period] - _MAX_LOSS:
            return int(period)
    return None


def find_bursts(force: Real) -> tuple[tuple[int, ...], int]:
    """Return the first sample of each burst of a record, and the samples from one to the next.

    A burst ends where the force rests for a fifth of the time between bursts.

    Args:
        force: one input; (1, n_sample).

    Returns:
        Starts and their smallest distance; no start where the force does not rest.
    """
    n_sample = force.shape[1]
    width = max(n_sample // _BINS, 4)
    power = uniform_filter1d((force[0] - np.median(force[0])) ** 2, 2 * width + 1, mode="nearest")
    active = np.flatnonzero(power > _REST_RATIO**2 * power.mean())
    gaps = np.diff(active, prepend=-n_sample)
    rest = np.flatnonzero(gaps > width)
    starts = active[rest]
    if len(starts) < _MIN_REPETITIONS:
        return (), n_sample
    length = int(min(np.diff(starts).min(), n_sample - starts[-1]))
    if gaps[rest[1:]].min() < _REST_GAP * length:
        return (), n_sample
    return tuple(starts.tolist()), length


def _is_at_rest(records: Records, starts: tuple[int, ...], length: int) -> bool:
    """Return whether force and motion rest at the end of the blocks.

    What is left there is small, or noise: nearly as much as a fifth of the block before.

    Args:
        starts: first sample of each block of a record.
        length: of a block [samples].
    """
    last, before = max(round(_REST_SHARE * length), 1), round(_BEFORE_SHARE * length)
    for signal in (records.force, *records.further_forces, *np.moveaxis(records.motion, 1, 0)):
        blocks = np.concatenate([signal[:, start : start + length] for start in starts])
        part = blocks - np.median(blocks, axis=1, keepdims=True)
        whole, end, earlier = (
            np.sqrt((piece**2).mean())
            for piece in (part, part[:, -last:], part[:, -last - before : -before])
        )
        is_noise = end <= _MAX_END_NOISE * whole and end >= _MIN_STEADY * earlier
        if not is_noise and end > _REST_RATIO * whole:
            return False
    return True


def _hann(length: int) -> Real:
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length))


def _independent_blocks(window: Real, hop: int, starts: tuple[int, ...]) -> float:
    """Return as how many independent blocks the overlapping ones of a record count."""
    count, energy, shared = len(starts), float(window @ window), 0.0
    for step in range(1, min(count, -(-len(window) // hop))):
        moved = step * hop
        product = float(window[moved:] @ window[:-moved]) / energy
        shared += (1 - step / count) * product**2
    return count / (1 + 2 * shared)
