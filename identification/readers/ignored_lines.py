"""Frequency lines that campaign.toml leaves out, such as those of mains hum.

The tests of a campaign share one frequency axis. Lines that one test leaves out are therefore left
out of all tests, before any check. The variance of a test without coherence, which compares
neighbouring lines, is computed before, so that no difference reaches across a gap.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from identification.words import Campaign, InputError, Mask

_MIN_LINES_LEFT = 4  # lines: fewer are no FRF


def _check_range(limits: list[float]) -> list[float]:
    """Refuse a range whose limits are negative or exchanged."""
    if limits[0] < 0 or limits[1] < limits[0]:
        raise ValueError("give the lower frequency first, both from 0 Hz, such as [49.5, 50.5]")
    return limits


# Lowest and highest frequency that are left out [Hz], both included.
FrequencyRange = Annotated[
    list[float], Field(min_length=2, max_length=2), AfterValidator(_check_range)
]

# A hundred harmonics of mains and of ten spindles are a thousand ranges; each is checked against
# all lines.
_MAX_RANGES = 10_000
FrequencyRanges = Annotated[list[FrequencyRange], Field(max_length=_MAX_RANGES)]


def leave_out_lines(path: Path, campaign: Campaign, ranges: list[list[float]]) -> Campaign:
    """Return the campaign without the lines of these ranges, with a remark.

    Args:
        path: path of campaign.toml, for messages.
        campaign: tests on one frequency axis.
        ranges: lowest and highest frequency of each range [Hz], both included.

    Raises:
        InputError: fewer than four lines remain.
    """
    if not ranges:
        return campaign
    ignored: Mask = np.zeros(len(campaign.freq_hz), bool)
    remarks = []
    for low, high in sorted(map(tuple, ranges)):
        inside = (campaign.freq_hz >= low) & (campaign.freq_hz <= high)
        if not inside.any():
            remarks.append(f"ignore_hz {low:g}..{high:g} Hz holds no frequency line")
        ignored |= inside
    if (~ignored).sum() < _MIN_LINES_LEFT:
        raise InputError(
            f"{path}: ignore_hz leaves {(~ignored).sum()} of {len(ignored)} lines: state narrower "
            "ranges"
        )
    if ignored.any():
        listed = ", ".join(f"{low:g}..{high:g}" for low, high in sorted(map(tuple, ranges)))
        remarks.append(
            f"{ignored.sum()} of {len(ignored)} frequency lines are left out of all tests, as "
            f"ignore_hz states: {listed} Hz"
        )
    remaining = campaign.select_lines(~ignored)
    return replace(remaining, remarks=(*campaign.remarks, *remarks))
