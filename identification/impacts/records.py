"""Records of one impact in which each channel keeps its own time: every sample has a stamp.

A file holds, for every channel, its stamps [s] and its accelerations [m/s2]: ``time_acc1_x`` and
``value_acc1_x`` in .npz or .mat, or rows of ``channel,time,value`` in .csv, such as
``acc1_x,0.00079,-0.013``. ``acc1_x`` is site and axis; ``acc1_-x`` reads in the opposite direction.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.readers.array_files import load_arrays
from identification.readers.csv_tables import read_csv_rows
from identification.words import MAX_INPUT_MAGNITUDE, Dof, InputError, Real
from identification.words.file_access import check_file

_CHANNEL_PATTERN = re.compile(r"(.+)_([-+]?)([xyz])$")
_MIN_SAMPLES = 16  # samples of a channel, for a spline of fifth order


@dataclass(frozen=True, eq=False)
class StampedChannel:
    """A channel with its own clock.

    Args:
        dof: site and direction.
        time: stamps, rising [s]; (n,).
        value: acceleration [m/s2]; (n,).
    """

    dof: Dof
    time: Real
    value: Real

    @property
    def name(self) -> str:
        """Site and axis, without the sign: ``acc1_x``."""
        return f"{self.dof.point}_{self.dof.direction[-1]}"


@dataclass(frozen=True, eq=False)
class ImpactRecord:
    """All channels of one impact.

    Args:
        source: file of the record.
        channels: each channel once.
    """

    source: str
    channels: tuple[StampedChannel, ...]


def read_impact(path: Path) -> ImpactRecord:
    """Read the channels of one impact.

    Args:
        path: .npz, .mat or .csv.

    Raises:
        InputError: no such file, a channel without stamps, or a clock that runs backwards.
    """
    if not os.path.exists(path):
        raise InputError(f"{path} is not there. Give a record as .npz, .mat or .csv.")
    check_file(path, "give a record as .npz, .mat or .csv")
    channels = _from_csv(path) if path.suffix.lower() == ".csv" else _from_arrays(path)
    return impact_record(str(path), channels)


def impact_record(source: str, channels_by_name: Mapping[str, tuple[Any, Any]]) -> ImpactRecord:
    """Check the channels of one impact and return them as a record.

    Args:
        source: origin of the channels, for messages.
        channels_by_name: stamps and values by site and axis.

    Raises:
        InputError: as for ``read_impact``.
    """
    if not channels_by_name:
        raise InputError(
            f"{source} has no channels. Name arrays time_acc1_x and value_acc1_x, or give rows of "
            "channel,time,value."
        )
    channels = tuple(
        _check_channel(
            source, name, _real_numbers(source, name, time), _real_numbers(source, name, value)
        )
        for name, (time, value) in channels_by_name.items()
    )
    positive = [channel.dof.positive for channel in channels]
    twice = sorted({str(dof) for dof in positive if positive.count(dof) > 1})
    if twice:
        raise InputError(f"{source} has {', '.join(twice)} twice. Leave one of them out.")
    return ImpactRecord(source, channels)


def _from_arrays(path: Path) -> dict[str, tuple[Any, Any]]:
    """Read stamps and values from .npz or .mat."""
    arrays = load_arrays(path)
    names = [key.removeprefix("time_") for key in arrays if key.startswith("time_")]
    values = [key.removeprefix("value_") for key in arrays if key.startswith("value_")]
    unpaired = sorted(set(names) ^ set(values))
    if unpaired:
        raise InputError(
            f"{path}: {unpaired[0]} has only stamps or only values. Give time_{unpaired[0]} and "
            f"value_{unpaired[0]}."
        )
    return {name: (arrays[f"time_{name}"], arrays[f"value_{name}"]) for name in names}


def _from_csv(path: Path) -> dict[str, tuple[Any, Any]]:
    """Read stamps and values from rows of channel, time and value."""
    rows: dict[str, tuple[list[float], list[float]]] = {}
    table = read_csv_rows(path, "give rows of channel,time,value")
    for number, row in enumerate(table, start=1):
        if number == 1 and row[:1] == ["channel"]:
            continue
        try:
            name, time, value = row
            channel = rows.setdefault(name.strip(), ([], []))
            channel[0].append(float(time))
            channel[1].append(float(value))
        except ValueError as error:
            raise InputError(
                f"{path}, row {number}: {','.join(row)!r} is not channel,time,value."
            ) from error
    return dict(rows)


def _real_numbers(source: str, name: str, values: Any) -> Real:
    """Return stamps or values as real numbers; (n,)."""
    array = np.asarray(values).ravel()
    if array.dtype.kind not in "fiu":
        raise InputError(f"{source}: {name} holds no real numbers. Save its samples as numbers.")
    return array.astype(np.float64)


def _check_channel(source: str, name: str, time: Real, value: Real) -> StampedChannel:
    """Check one channel and return it with its degree of freedom."""
    match = _CHANNEL_PATTERN.match(name)
    if match is None or ":" in match[1]:
        raise InputError(f"{source}: {name!r} names no axis. Call it by site and axis, as acc1_x.")
    if len(time) != len(value):
        raise InputError(f"{source}: {name} has {len(time)} stamps for {len(value)} values.")
    if len(time) < _MIN_SAMPLES:
        raise InputError(f"{source}: {name} has {len(time)} samples; {_MIN_SAMPLES} are the least.")
    is_sane = [np.abs(numbers).max() <= MAX_INPUT_MAGNITUDE for numbers in (time, value)]
    if not all(is_sane):  # NaN is not below the limit either
        raise InputError(
            f"{source}: {name} holds values that are no numbers or beyond "
            f"{MAX_INPUT_MAGNITUDE:g}. Leave these out."
        )
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        k = int(back[0])
        raise InputError(
            f"{source}: the clock of {name} does not go forward at sample {k + 2}: "
            f"{time[k + 1]:.6g} s after {time[k]:.6g} s. Sort its samples, or mend the stamps "
            "where it was reset."
        )
    site, sign, axis = match.groups()
    return StampedChannel(Dof(site, f"{sign or '+'}t{axis}"), time, value)
