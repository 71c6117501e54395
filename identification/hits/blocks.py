"""Blocks of one hit each, cut from the records, with their offsets removed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.hits.block_plan import BlockPlan
from identification.hits.detection import Blow, quiet_force
from identification.words import HitRejection, Mask, Real, Records

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
