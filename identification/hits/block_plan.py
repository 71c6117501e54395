"""One length of block, one pre-trigger for all hits of a campaign, so that their lines agree."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft

from identification.hits.detection import Blow
from identification.hits.settings import HitSettings
from identification.words import InputError, Records

_PRETRIGGER = 0.02  # of the time between hits
_WIDTHS = 3  # of a pulse: the least pre-trigger
_LATEST = 0.25  # of a record of one hit, up to which all before the hit is pre-trigger
_SHORT = 0.5  # of the median time to the next hit: less does not set the length of all blocks
_LEAST = 32  # samples of a block


@dataclass(frozen=True)
class Plan:
    """How blocks are cut.

    Args:
        block: samples.
        pretrigger: samples of it before the first rise of the force.
    """

    block: int
    pretrigger: int


def plan_blocks(
    records: Sequence[Records],
    blows: Sequence[Sequence[Blow]],
    settings: Sequence[HitSettings],
) -> Plan:
    """Choose block and pre-trigger for all records of a campaign.

    A block reaches from the pre-trigger before its hit to the next hit's, or to the end of the
    record. The shortest sets the length of all, but for those below half the median: such hits
    are rejected instead. Where every record holds one hit, all of the record is the block if the
    pre-trigger is at most a quarter of it; else the pre-trigger is 2 % of the time to the next
    hit, and at least three widths of a pulse.

    Args:
        records: of every reference, at one rate.
        blows: of each; at least one altogether.
        settings: of each; what one of them states holds for all.

    Raises:
        InputError: settings that contradict one another or the records, no hit at all.
    """
    rate = records[0].rate_hz
    for own in records:
        if own.rate_hz != rate:
            raise InputError(
                f"{own.test} was sampled at {own.rate_hz:g} Hz and {records[0].test} at {rate:g} "
                "Hz: records of one campaign share their rate; resample one of them"
            )
    for own, found in zip(records, blows, strict=True):
        if not found:
            raise InputError(
                f"{own.test}: there is no hit in the force along {own.reference}: check which "
                "channel is the force"
            )
    every = [blow for found in blows for blow in found]
    spans = np.array([blow.until for blow in every])
    span = int(spans[spans >= _SHORT * np.median(spans)].min())
    pretrigger, single = _pretrigger(records, blows, span)
    stated = common(records, settings, "pretrigger_s")
    if stated is not None:
        pretrigger, single = round(stated * rate), False
    length = common(records, settings, "block_s")
    if length is not None:
        block = round(length * rate)
    elif single:
        block = min(own.force.shape[1] for own in records)
    else:
        # The next hit's own pre-trigger is still free of it.
        between = [b.until - pretrigger for b in every if not b.is_last and b.until >= span]
        block = 2 * scipy.fft.prev_fast_len((pretrigger + min([span, *between])) // 2)
    block -= block % 2
    if block < max(_LEAST, 2 * pretrigger):
        raise InputError(
            f"{records[0].test}: blocks of {block} samples with {pretrigger} before the hit are "
            "too short: state block_s and pretrigger_s"
        )
    return Plan(block, pretrigger)


def _pretrigger(
    records: Sequence[Records], blows: Sequence[Sequence[Blow]], span: int
) -> tuple[int, bool]:
    """Samples before a hit, and whether every record is one block."""
    first = [
        [blow.onset for blow in found if blow.main.record == number]
        for own, found in zip(records, blows, strict=True)
        for number in range(len(own.force))
    ]
    samples = min(own.force.shape[1] for own in records)
    early = int(np.median([onsets[0] for onsets in first if onsets]))
    alone = np.mean([len(onsets) <= 1 for onsets in first]) > _SHORT
    if alone and early <= _LATEST * samples:
        return early, True
    width = max(blow.main.width for found in blows for blow in found)
    return max(round(_PRETRIGGER * span), _WIDTHS * width), False


def common(records: Sequence[Records], settings: Sequence[HitSettings], key: str) -> float | None:
    """What any of the settings states, the same for all.

    Raises:
        InputError: two different values.
    """
    stated = {
        value: own.test
        for own, setting in zip(records, settings, strict=True)
        if (value := getattr(setting, key)) is not None
    }
    if len(stated) > 1:
        texts = ", ".join(f"{value:g} s for {test}" for value, test in stated.items())
        raise InputError(f"{key} is {texts}: tests of one campaign share it; state one value")
    return next(iter(stated), None)
