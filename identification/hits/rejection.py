"""Which hits are left out, one by one, and the reason of each."""

from collections.abc import Callable

import numpy as np

from identification.hits.blocks import Blocks, rejected
from identification.hits.outliers import mirrored, outlying
from identification.words import Complex, Mask, Real, Rejected

_SECOND = 0.05  # of the peak: a bounce that counts
_WEAK = 0.25  # of the median peak
_FLAT = 3  # samples equal to the largest of their channel
_STEPS = 10  # of the converter below it
_SPARSE = 1 / 3  # as many samples in those steps, relative to the largest
_DIGITS = 1e-5  # step of a text file of six digits, relative
_FULL = 0.999  # of a stated ceiling
_COPY = 1e-5  # relative difference: six digits of a text file

Reasons = list[str | None]


def reject(
    blocks: Blocks, spectra: Callable[[Blocks], tuple[Complex, Complex]]
) -> tuple[Blocks, tuple[Rejected, ...]]:
    """Leave out copied, clipped, double, overlapping, weak, mirrored and outlying hits.

    The first reason found stands. Those that compare spectra see what the others left.

    Args:
        blocks: the hits of one reference.
        spectra: force and motion of blocks; (n_hit, n_freq) and (n_hit, n_freq, n_out).
    """
    left_out: list[Rejected] = []
    for judge in (_copies, _overloads, _doubles, _overlaps, _weak):
        blocks = _without(blocks, judge(blocks), left_out)
    for compare in (mirrored, outlying):
        if len(blocks.blows) > 2:
            blocks = _without(blocks, compare(*spectra(blocks)), left_out)
    return blocks, tuple(sorted(left_out, key=lambda one: one.hit))


def _without(blocks: Blocks, reasons: Reasons, left_out: list[Rejected]) -> Blocks:
    rate = blocks.records.rate_hz
    left_out += [
        rejected(blow, rate, reason)
        for blow, reason in zip(blocks.blows, reasons, strict=True)
        if reason is not None
    ]
    return blocks.keep(np.array([reason is None for reason in reasons], bool))


def _overloads(blocks: Blocks) -> Reasons:
    records, length = blocks.records, blocks.plan.block
    names = [f"the force along {records.reference}", *map(str, records.outputs)]
    places = [
        (blow.main.record, slice(start, start + length))
        for blow, start in zip(blocks.blows, blocks.starts, strict=True)
    ]
    reasons: Reasons = [None] * len(places)
    for channel, name in enumerate(names):
        source = records.motion[:, channel - 1] if channel else records.force
        values = np.array([source[record, part] for record, part in places])
        if not values.size:
            continue
        full = _at_ceiling(values)
        if records.ceilings is not None:
            full |= np.abs(values) >= _FULL * records.ceilings[channel]
        for hit in np.flatnonzero(full.any(axis=1)):
            reasons[hit] = reasons[hit] or f"{name} is overloaded"
    return reasons


def _at_ceiling(values: Real) -> Mask:
    """Samples at the largest or least value of a channel, if that is a ceiling; its shape.

    Where a converter clips, its largest value comes several times and those just below it hardly
    ever. A crest of height A stays within k steps q below its top for a phase of
    2 sqrt(2 k q / A): the next ten values are together 2.3 times as frequent as the largest. The
    step is the least difference of two values, and at least that of a text file of six digits.
    Clipping before a digital filter leaves no equal samples: it is not seen here.
    """
    full = np.zeros(values.shape, bool)
    for extreme in (values.max(), values.min()):
        at = values == extreme
        if at.sum() < _FLAT:
            continue
        step = np.diff(np.unique(values)).min(initial=np.inf)
        reach = _STEPS * max(float(step), _DIGITS * abs(float(extreme)))
        near = (np.abs(values - extreme) <= reach) & ~at
        if np.isfinite(reach) and near.sum() < _SPARSE * at.sum():
            full |= at
    return full


def _doubles(blocks: Blocks) -> Reasons:
    reasons: Reasons = []
    for blow in blocks.blows:
        share = max((abs(b.height / blow.main.height) for b in blow.bounces), default=0.0)
        reasons.append(
            f"double hit, the second with {100 * share:.0f} % of the force"
            if share > _SECOND
            else None
        )
    return reasons


def _overlaps(blocks: Blocks) -> Reasons:
    ends = [start + blocks.plan.block for start in blocks.starts]
    return [
        "the next hit is in its block"
        if not blow.is_last and blow.onset + blow.until < end
        else None
        for blow, end in zip(blocks.blows, ends, strict=True)
    ]


def _copies(blocks: Blocks) -> Reasons:
    """Blocks that are a multiple of an earlier one: |a - c b| <= 1e-5 |a|, force and motion."""
    n_hit = len(blocks.blows)
    force, motion = blocks.force, blocks.motion.reshape(n_hit, -1)
    gram_force, gram = force @ force.T, motion @ motion.T
    reasons: Reasons = [None] * n_hit
    for hit in range(n_hit):
        for earlier in range(hit):
            scale = gram_force[hit, earlier] / max(gram_force[earlier, earlier], 1e-300)
            away = 0.0
            for sums, rows in ((gram_force, force), (gram, motion)):
                size = max(float(sums[hit, hit]), 1e-300)
                if sums[hit, earlier] ** 2 < (1 - _COPY) * size * sums[earlier, earlier]:
                    away = 1.0  # plainly another one
                    break
                away = max(away, ((rows[hit] - scale * rows[earlier]) ** 2).sum() / size)
            if away <= _COPY**2:
                number = blocks.blows[earlier].number
                exactly = "equal to" if abs(scale - 1) <= _COPY else f"{scale:.4g} times"
                reasons[hit] = reasons[hit] or f"a copy: {exactly} hit {number}"
    return reasons


def _weak(blocks: Blocks) -> Reasons:
    peaks = np.abs([blow.main.height for blow in blocks.blows])
    middle = float(np.median(peaks)) if peaks.size else 0.0
    return [
        f"weak: {peak:.3g} N, the median is {middle:.3g} N" if peak < _WEAK * middle else None
        for peak in peaks
    ]
