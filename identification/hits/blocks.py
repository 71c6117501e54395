"""Blocks of one hit each, cut from the records, with their offsets removed.

Block length and pre-trigger, one for all hits of a campaign so that frequency lines agree.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.fft

from identification.hits.detection import Blow, is_continuous, quiet_force
from identification.hits.settings import HitSettings
from identification.words import HitRejection, InputError, Mask, Real, Records

_PRETRIGGER_SHARE = 0.02  # of the time between hits
_MIN_PRETRIGGER_WIDTHS = 3  # pulse widths
_MAX_PRETRIGGER_SHARE = 0.25  # of a record with one hit, if all before the hit is pre-trigger
_MIN_SPAN_SHARE = 0.5  # of the median time to the next hit: less does not limit all blocks
_MIN_SINGLE_HIT_SHARE = 0.5  # of the records: with more, every record is taken as one block
_MIN_BLOCK_SAMPLES = 32  # samples of a block


@dataclass(frozen=True)
class BlockPlan:
    """Block length and pre-trigger of all hits.

    Args:
        block: length of a block [samples].
        pretrigger: part of a block before the first rise of the force [samples].
    """

    block: int
    pretrigger: int


def plan_blocks(
    records: Sequence[Records],
    blows: Sequence[Sequence[Blow]],
    settings: Sequence[HitSettings],
) -> BlockPlan:
    """Choose block length and pre-trigger for all records of a campaign.

    A block reaches from its pre-trigger to the pre-trigger of the next hit, or to the end of the
    record. The shortest block sets the length of all. Blocks below half the median are ignored
    here, and their hits are rejected later.

    If most records hold one hit, the whole record is the block, provided that the pre-trigger is at
    most a quarter of it. Otherwise the pre-trigger is 2 % of the time to the next hit, and at least
    three pulse widths.

    Args:
        records: records of every reference, all with one sampling rate.
        blows: hits in each of the records.
        settings: settings of each of the records; a given value holds for all.

    Raises:
        InputError: settings contradict one another or the records, or records have no hit.
    """
    rate = records[0].rate_hz
    for reference in records:
        if reference.rate_hz != rate:
            raise InputError(
                f"{reference.test} was sampled at {reference.rate_hz:g} Hz and {records[0].test} "
                f"at {rate:g} Hz: records of one campaign need one rate; resample one of them"
            )
    for reference, hits in zip(records, blows, strict=True):
        if is_continuous(reference, hits):
            raise InputError(
                f"{reference.test}: the force along {reference.reference} never rests or pulls as "
                "much as it pushes, which is no series of hits"
            )
    all_blows = [blow for hits in blows for blow in hits]
    spans = np.array([blow.span for blow in all_blows])
    span = int(spans[spans >= _MIN_SPAN_SHARE * np.median(spans)].min())
    pretrigger, is_single = _choose_pretrigger(records, blows, span)
    setting = common_setting(records, settings, "pretrigger_s")
    if setting is not None:
        pretrigger, is_single = round(setting * rate), False
    length = common_setting(records, settings, "block_s")
    if length is not None:
        block = round(length * rate)
    elif is_single:
        block = min(reference.force.shape[1] for reference in records)
    else:
        # The block ends where the pre-trigger of the next hit begins.
        between = [b.span - pretrigger for b in all_blows if not b.is_last and b.span >= span]
        block = 2 * scipy.fft.prev_fast_len((pretrigger + min([span, *between])) // 2)
    block -= block % 2
    if block < max(_MIN_BLOCK_SAMPLES, 2 * pretrigger):
        raise InputError(
            f"{records[0].test}: blocks of {block} samples with {pretrigger} before the hit are "
            "too short: set block_s and pretrigger_s"
        )
    return BlockPlan(block, pretrigger)


def _choose_pretrigger(
    records: Sequence[Records], blows: Sequence[Sequence[Blow]], span: int
) -> tuple[int, bool]:
    """Return the pre-trigger [samples], and whether every record is one block."""
    onsets_of_records = [
        [blow.onset for blow in hits if blow.main.record == number]
        for reference, hits in zip(records, blows, strict=True)
        for number in range(len(reference.force))
    ]
    n_sample = min(reference.force.shape[1] for reference in records)
    first_onset = int(np.median([onsets[0] for onsets in onsets_of_records if onsets]))
    single_share = np.mean([len(onsets) <= 1 for onsets in onsets_of_records])
    is_single = single_share > _MIN_SINGLE_HIT_SHARE
    if is_single and first_onset <= _MAX_PRETRIGGER_SHARE * n_sample:
        return first_onset, True
    width = max(blow.main.width for hits in blows for blow in hits)
    return max(round(_PRETRIGGER_SHARE * span), _MIN_PRETRIGGER_WIDTHS * width), False


def common_setting(
    records: Sequence[Records], settings: Sequence[HitSettings], key: str
) -> float | None:
    """Return the value of a setting that all records share, or None if no record sets it.

    Raises:
        InputError: two records set different values.
    """
    test_of = {
        value: reference.test
        for reference, setting in zip(records, settings, strict=True)
        if (value := getattr(setting, key)) is not None
    }
    if len(test_of) > 1:
        texts = ", ".join(f"{value:g} s for {test}" for value, test in test_of.items())
        raise InputError(f"{key} is {texts}: tests of one campaign share it; set one value")
    return next(iter(test_of), None)


_MIN_OFFSET_SAMPLES = 16  # samples before the first hit, for the offset of the motion
_MAX_BLOCK_MOVE = 0.5  # of the pre-trigger, by which a block may move to stay in its record


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of the hits of one reference.

    Args:
        records: records from which the blocks were cut.
        blows: hits; n_hit.
        starts: first sample of each block in its record; n_hit.
        plan: block length and pre-trigger.
        force: force without its offset [N]; (n_hit, n_sample).
        motion: motion without its offset; (n_hit, n_out, n_sample).
    """

    records: Records
    blows: tuple[Blow, ...]
    starts: tuple[int, ...]
    plan: BlockPlan
    force: Real
    motion: Real

    def keep(self, chosen: Mask) -> Self:
        """Return the blocks of these hits alone.

        Args:
            chosen: mask of the hits; (n_hit,).
        """
        numbers = np.flatnonzero(chosen)
        return replace(
            self,
            blows=tuple(self.blows[n] for n in numbers),
            starts=tuple(self.starts[n] for n in numbers),
            force=self.force[numbers],
            motion=self.motion[numbers],
        )


def rejection(blow: Blow, rate_hz: float, reason: str) -> HitRejection:
    """Return the rejection of a hit with its reason."""
    return HitRejection(blow.main.record + 1, blow.number, blow.onset / rate_hz, reason)


def cut_blocks(
    records: Records, blows: Sequence[Blow], plan: BlockPlan
) -> tuple[Blocks, tuple[HitRejection, ...]]:
    """Cut a block around every hit whose block fits into its record.

    The offset of the force is the median of its block. The offset of a motion is its mean before
    the first hit of the record, if there are at least 16 samples. The mean after a hit does not
    serve: a machine on soft springs need not return to its place within the record.

    Returns:
        The blocks, and the hits that have none.
    """
    motion = records.motion - _motion_offsets(records, blows)[:, :, None]
    n_sample, kept, starts, left_out = motion.shape[2], [], [], []
    for blow in blows:
        wanted = blow.onset - plan.pretrigger
        start = min(max(wanted, 0), n_sample - plan.block)
        is_moved_far = abs(start - wanted) > _MAX_BLOCK_MOVE * plan.pretrigger
        if start < 0 or is_moved_far or blow.onset == 0 or blow.end - start > plan.block:
            reason = "its block leaves the record" if blow.onset else "it begins before the record"
            left_out.append(rejection(blow, records.rate_hz, reason))
        else:
            kept.append(blow)
            starts.append(start)
    slices = [(b.main.record, slice(s, s + plan.block)) for b, s in zip(kept, starts, strict=True)]
    blocks = Blocks(
        records,
        tuple(kept),
        tuple(starts),
        plan,
        np.array([quiet_force(records.force[record, part])[0] for record, part in slices]).reshape(
            -1, plan.block
        ),
        np.array([motion[record, :, part] for record, part in slices]).reshape(
            -1, len(records.outputs), plan.block
        ),
    )
    return blocks, tuple(left_out)


def quiet_samples(blows: Sequence[Blow], n_record: int, n_sample: int) -> list[int]:
    """Return the number of samples before the first hit of each record; n_record.

    One pulse width before the hit is left out.
    """
    quiet = [n_sample] * n_record
    for blow in blows:
        record = blow.main.record
        quiet[record] = min(quiet[record], max(blow.onset - blow.main.width, 0))
    return quiet


def _motion_offsets(records: Records, blows: Sequence[Blow]) -> Real:
    """Return the means of the motion before the first hit; (n_record, n_out)."""
    offsets = np.zeros(records.motion.shape[:2])
    for record, count in enumerate(quiet_samples(blows, *records.force.shape)):
        if count >= _MIN_OFFSET_SAMPLES:
            offsets[record] = records.motion[record, :, :count].mean(axis=1)
    return offsets
