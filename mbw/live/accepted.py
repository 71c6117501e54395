"""Campaign of the accepted hits, which every verb reads: one block for each of them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identification.readers.array_records import write_array_records
from identification.words import HitEstimate, Records
from mbw.live.test import LiveTest, Place, Sheet
from tuning.files.states_campaign import write_campaign_with_tests

# What the records that are written have in SI, or what has been done with them.
_SETTLED_KEYS = {"file", "unit", "columns", "averages", "time_sign", "references", "channels"}
_BLOCK_KEYS = {"block_s", "pretrigger_s"}


def write_accepted(
    test: LiveTest, sheet: Sheet, places: Sequence[Place], staging: Path, folder: Path
) -> None:
    """Write the accepted hits of some places as a campaign.

    Args:
        test: with campaign.toml, which states all else.
        sheet: hits, as they are judged.
        places: those whose hits are written.
        staging: existing folder into which the files are written.
        folder: where they are in the end.
    """
    blocks = []
    for number, place in enumerate(places, start=1):
        records = cut_accepted(sheet.records[place], sheet.estimates[place])
        name = f"hits_{number:02}.npz"
        write_array_records(staging / name, [records])
        stated = test.settings.test[place[0]].model_dump(exclude_unset=True, exclude=_SETTLED_KEYS)
        blocks.append(_describe(stated, name, records))
    write_campaign_with_tests(test.source, blocks, staging, folder)


def cut_accepted(records: Records, estimate: HitEstimate) -> Records:
    """Return one record for the block of each accepted hit.

    Args:
        records: records of a place.
        estimate: its FRFs, with the hits that were kept.
    """
    rate = records.rate_hz
    size = round(estimate.block_s * rate)
    starts = [
        (hit.record - 1, round((hit.time_s - estimate.pretrigger_s) * rate))
        for hit in estimate.kept
    ]
    last = records.force.shape[1] - size
    parts = [(row, slice(max(min(start, last), 0), None)) for row, start in starts]
    return replace(
        records,
        force=np.stack([records.force[row, part][:size] for row, part in parts]),
        motion=np.stack([records.motion[row, :, part][:, :size] for row, part in parts]),
    )


def _describe(stated: dict[str, Any], name: str, records: Records) -> dict[str, Any]:
    """Return the ``[[test]]`` of a file of accepted hits, which no verb is to judge again."""
    return {
        "file": name,
        **{key: value for key, value in stated.items() if key not in _BLOCK_KEYS},
        "references": [str(records.reference)],
        "channels": [str(dof) for dof in records.outputs],
        "quantity": records.quantity,
        "averages": len(records.force),
        "reject": False,
    }
