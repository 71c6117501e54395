"""Rejection of hits that would spoil the average, each with its reason."""

from collections.abc import Callable, Sequence

import numpy as np

from identification.hits.blocks import Blocks, rejection
from identification.hits.hit_signals import find_dead_channels
from identification.hits.outliers import Reasons, find_mirrored_hits, find_outlying_hits
from identification.words import Complex, HitRejection, Mask, Real

_MIN_BOUNCE_HEIGHT = 0.05  # of the main pulse, for a double hit
MIN_PEAK = 0.25  # of the median peak: weaker hits are rejected
# A channel is clipped if at least this number of samples equals its extreme value, and the next
# steps of the converter hold fewer samples than this share of that number.
_MIN_CLIPPED_SAMPLES, _CLIPPING_STEPS, _MAX_NEAR_SHARE = 3, 10, 1 / 3
_MIN_CLIPPED_BOTH_WAYS = 4  # samples, at limits of equal size of a converter
_TEXT_STEP = 1e-5  # relative step of a text file with six digits
_FULL_SCALE_SHARE = 0.999  # of a known full scale, for an overload
_MAX_COPY_DIFFERENCE = 1e-5  # relative: six digits of a text file
_TINY_BLOCK_ENERGY = 1e-300  # avoids a division by zero


def reject_hits(
    blocks: Blocks,
    spectra: Callable[[Blocks], tuple[Complex, Complex]],
    further: Sequence[Callable[[Blocks], Reasons]] = (),
) -> tuple[Blocks, tuple[HitRejection, ...]]:
    """Leave out copied, clipped, double, overlapping, weak, dead, mirrored and outlying hits.

    The checks run in this order; each sees the hits that the earlier ones kept.

    Args:
        blocks: blocks of one reference.
        spectra: function that returns the spectra of force (n_hit, n_freq) and motion
            (n_hit, n_freq, n_out) of blocks.
        further: checks between those of single hits and those among hits.

    Returns:
        The kept blocks, and the rejected hits with their reasons.
    """
    left_out: list[HitRejection] = []
    checks = (
        _find_copies,
        _find_overloads,
        _find_doubles,
        _find_overlaps,
        _find_weak,
        *further,
        _find_dead,
    )
    for check in checks:
        blocks = _without(blocks, check(blocks), left_out)
    for compare in (find_mirrored_hits, find_outlying_hits):
        if len(blocks.blows) > 2:
            blocks = _without(blocks, compare(*spectra(blocks)), left_out)
    return blocks, tuple(sorted(left_out, key=lambda rejection: rejection.hit))


def _without(blocks: Blocks, reasons: Reasons, left_out: list[HitRejection]) -> Blocks:
    """Return the blocks that have no reason for rejection; append the others to ``left_out``."""
    rate = blocks.records.rate_hz
    left_out += [
        rejection(blow, rate, reason)
        for blow, reason in zip(blocks.blows, reasons, strict=True)
        if reason is not None
    ]
    return blocks.keep(np.array([reason is None for reason in reasons], bool))


def _find_overloads(blocks: Blocks) -> Reasons:
    """Find hits with a clipped force or motion."""
    records, length = blocks.records, blocks.plan.block
    names = [f"the force along {records.reference}", *map(str, records.outputs)]
    parts = [
        (blow.main.record, slice(start, start + length))
        for blow, start in zip(blocks.blows, blocks.starts, strict=True)
    ]
    reasons: Reasons = [None] * len(parts)
    for channel, name in enumerate(names):
        source = records.motion[:, channel - 1] if channel else records.force
        values = np.array([source[record, part] for record, part in parts])
        if not values.size:
            continue
        is_clipped = _clipped_samples(values)
        if records.ceilings is not None:
            is_clipped |= np.abs(values) >= _FULL_SCALE_SHARE * records.ceilings[channel]
        for hit in np.flatnonzero(is_clipped.any(axis=1)):
            reasons[hit] = reasons[hit] or f"{name} is overloaded"
    return reasons


def _clipped_samples(values: Real) -> Mask:
    """Return the samples at the largest or smallest value of a channel, if it clips there.

    A converter that clips repeats its extreme value, and hardly ever gives values just below it. An
    unclipped crest of height A, in contrast, stays within k steps q of its top for a phase of
    2 sqrt(2 k q / A): the next ten values together are 2.3 times as frequent as the largest. The
    step is the smallest difference of two values, and at least that of a text file with six
    digits. Limits of equal size on both sides count together. Clipping before a digital filter
    leaves no equal samples and is not detected.

    Args:
        values: samples of one channel; (n_hit, n_sample).

    Returns:
        Mask of clipped samples; (n_hit, n_sample).
    """
    is_clipped, least = np.zeros(values.shape, bool), _MIN_CLIPPED_SAMPLES
    if values.max() == -values.min():
        values, least = np.abs(values), _MIN_CLIPPED_BOTH_WAYS
    for extreme in (values.max(), values.min()):
        is_extreme = values == extreme
        if is_extreme.sum() < least:
            continue
        step = np.diff(np.unique(values)).min(initial=np.inf)
        reach = _CLIPPING_STEPS * max(float(step), _TEXT_STEP * abs(float(extreme)))
        is_near = (np.abs(values - extreme) <= reach) & ~is_extreme
        if np.isfinite(reach) and is_near.sum() < _MAX_NEAR_SHARE * is_extreme.sum():
            is_clipped |= is_extreme
    return is_clipped


def _find_doubles(blocks: Blocks) -> Reasons:
    """Find double hits: those with a bounce above 5 % of the main pulse."""
    reasons: Reasons = []
    for blow in blocks.blows:
        share = max((abs(b.height / blow.main.height) for b in blow.bounces), default=0.0)
        reasons.append(
            f"double hit, the second with {100 * share:.0f} % of the force"
            if share > _MIN_BOUNCE_HEIGHT
            else None
        )
    return reasons


def _find_overlaps(blocks: Blocks) -> Reasons:
    """Find hits whose block holds the next hit."""
    ends = [start + blocks.plan.block for start in blocks.starts]
    return [
        "the next hit is in its block"
        if not blow.is_last and blow.onset + blow.span < end
        else None
        for blow, end in zip(blocks.blows, ends, strict=True)
    ]


def _find_copies(blocks: Blocks) -> Reasons:
    """Find blocks that are a multiple of an earlier one: |a - c b| <= 1e-5 |a| in all channels."""
    n_hit = len(blocks.blows)
    force, motion = blocks.force, blocks.motion.reshape(n_hit, -1)
    gram_force, gram_motion = force @ force.T, motion @ motion.T
    reasons: Reasons = [None] * n_hit
    for hit in range(n_hit):
        for earlier in range(hit):
            scale = gram_force[hit, earlier] / max(gram_force[earlier, earlier], _TINY_BLOCK_ENERGY)
            difference = 0.0
            for gram, rows in ((gram_force, force), (gram_motion, motion)):
                size = max(float(gram[hit, hit]), _TINY_BLOCK_ENERGY)
                limit = (1 - _MAX_COPY_DIFFERENCE) * size * gram[earlier, earlier]
                if gram[hit, earlier] ** 2 < limit:
                    difference = 1.0  # clearly different
                    break
                difference = max(
                    difference, ((rows[hit] - scale * rows[earlier]) ** 2).sum() / size
                )
            if difference <= _MAX_COPY_DIFFERENCE**2:
                number = blocks.blows[earlier].number
                is_equal = abs(scale - 1) <= _MAX_COPY_DIFFERENCE
                relation = "equal to" if is_equal else f"{scale:.4g} times"
                reasons[hit] = reasons[hit] or f"a copy: {relation} hit {number}"
    return reasons


def _find_weak(blocks: Blocks) -> Reasons:
    """Find hits with a peak below a quarter of the median peak."""
    peaks = np.abs([blow.main.height for blow in blocks.blows])
    median = float(np.median(peaks)) if peaks.size else 0.0
    return [
        f"weak: {peak / median:.2g} times the median peak" if peak < MIN_PEAK * median else None
        for peak in peaks
    ]


def _find_dead(blocks: Blocks) -> Reasons:
    """Find hits in which a channel is dead that other hits show alive."""
    if len(blocks.blows) < 2:
        return [None] * len(blocks.blows)
    is_dead, _ = find_dead_channels(blocks)
    return ["a channel is dead that is alive in other hits" if dead else None for dead in is_dead]
