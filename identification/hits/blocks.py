"""Blocks of one hit each, cut out of the records, their zero lines taken off."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.hits.block_plan import Plan
from identification.hits.detection import Blow, quiet_force
from identification.words import Mask, Real, Records, Rejected

_QUIET = 16  # samples before the first hit that make a zero line of the motion
_SLACK = 0.5  # of the pre-trigger, by which a block may be moved to stay in its record


@dataclass(frozen=True, eq=False)
class Blocks:
    """The hits of one reference side by side.

    Args:
        records: where they were cut.
        blows: the hits; n_hit.
        starts: first sample of each block in its record; n_hit.
        plan: length and pre-trigger.
        force: without its zero line; (n_hit, n_sample).
        motion: likewise; (n_hit, n_out, n_sample).
    """

    records: Records
    blows: tuple[Blow, ...]
    starts: tuple[int, ...]
    plan: Plan
    force: Real
    motion: Real

    def keep(self, chosen: Mask) -> Self:
        """Keep these hits; (n_hit,)."""
        numbers = np.flatnonzero(chosen)
        return replace(
            self,
            blows=tuple(self.blows[n] for n in numbers),
            starts=tuple(self.starts[n] for n in numbers),
            force=self.force[numbers],
            motion=self.motion[numbers],
        )


def rejected(blow: Blow, rate_hz: float, reason: str) -> Rejected:
    """Name a hit that is left out."""
    return Rejected(blow.main.record + 1, blow.number, blow.onset / rate_hz, reason)


def cut_blocks(
    records: Records, blows: Sequence[Blow], plan: Plan
) -> tuple[Blocks, tuple[Rejected, ...]]:
    """Cut a block around every hit that has room for one in its record.

    The zero line of the force is the median of its block, that of a motion its mean before the
    first hit of the record, if at least 16 samples are there: a machine on soft springs need not
    have a mean of zero afterwards.
    """
    motion = records.motion - _zero_lines(records, blows)[:, :, None]
    samples, kept, starts, left_out = motion.shape[2], [], [], []
    for blow in blows:
        wanted = blow.onset - plan.pretrigger
        start = min(max(wanted, 0), samples - plan.block)
        moved = abs(start - wanted) > _SLACK * plan.pretrigger
        if start < 0 or moved or blow.onset == 0 or blow.end - start > plan.block:
            reason = "its block leaves the record" if blow.onset else "it begins before the record"
            left_out.append(rejected(blow, records.rate_hz, reason))
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
    """Samples before the first hit of each record, a width of its pulse left aside; n_record."""
    quiet = [n_sample] * n_record
    for blow in blows:
        record = blow.main.record
        quiet[record] = min(quiet[record], max(blow.onset - blow.main.width, 0))
    return quiet


def _zero_lines(records: Records, blows: Sequence[Blow]) -> Real:
    lines = np.zeros(records.motion.shape[:2])
    for record, count in enumerate(quiet_samples(blows, *records.force.shape)):
        if count >= _QUIET:
            lines[record] = records.motion[record, :, :count].mean(axis=1)
    return lines
