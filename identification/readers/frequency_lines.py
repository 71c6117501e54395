"""Frequency lines of a campaign: those that all tests have, less those that it leaves out.

The tests of a campaign share one frequency axis. Lines that one test lacks or leaves out, such as
those of mains hum, are therefore left out of all tests, before any check. The variance of a test
without coherence, which compares neighbouring lines, is computed before, so that no difference
reaches across a gap.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from identification.words import Campaign, InputError, Mask, Test

_MIN_LINES_LEFT = 4  # lines: fewer are no FRF
# Of the lines of the shortest test: axes that meet now and then by chance are no common axis.
_MIN_SHARED_LINES = 0.5
_AXIS_DIGITS = 6  # decimals of a line in units of the spacing: texts round frequencies


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


def keep_common_lines(tests: Sequence[Test]) -> tuple[tuple[Test, ...], tuple[str, ...]]:
    """Return tests on the frequency lines that all of them have, and a remark if some have more.

    Bands and spacings may differ, such as those of two visits to a machine, as long as one axis
    holds half of the lines of another. Tests that have no common axis are returned as they are.

    Args:
        tests: tests on ascending frequency lines.
    """
    axes = [test.estimate.frf.freq_hz for test in tests]
    if len(axes) < 2 or all(np.array_equal(axis, axes[0]) for axis in axes[1:]):
        return tuple(tests), ()
    shortest = min(map(len, axes))
    spacing = min(float(np.diff(axis).min(initial=np.inf)) for axis in axes)
    if not 0 < spacing < np.inf:
        return tuple(tests), ()
    rounded = [np.round(axis / spacing, _AXIS_DIGITS) for axis in axes]
    common = reduce(np.intersect1d, rounded)
    if len(common) < max(_MIN_SHARED_LINES * shortest, _MIN_LINES_LEFT):
        return tuple(tests), ()
    kept = [
        replace(test, estimate=test.estimate.select_lines(np.isin(axis, common)))
        for test, axis in zip(tests, rounded, strict=True)
    ]
    freq_hz = kept[0].estimate.frf.freq_hz
    same_axis = [
        replace(
            test,
            estimate=replace(test.estimate, frf=replace(test.estimate.frf, freq_hz=freq_hz)),
        )
        for test in kept
    ]
    longer = {
        test.condition.test: len(axis)
        for test, axis in zip(tests, axes, strict=True)
        if len(axis) > len(common)
    }
    listed = ", ".join(f"{count} of {name}" for name, count in longer.items())
    remark = (
        f"tests have different frequency lines: of {listed} the {len(common)} count that all "
        "tests have"
    )
    return tuple(same_axis), (remark,)


def leave_out_lines(path: Path, campaign: Campaign, ranges: list[list[float]]) -> Campaign:
    """Return the campaign without the lines of these ranges, with a remark.

    Args:
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
