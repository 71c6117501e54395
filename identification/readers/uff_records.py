"""Time records of a universal file: function type 1 of dataset 58 and 58b.

The force is the channel whose ordinate is an excitation force (13); motions are displacement (8),
velocity (11) and acceleration (12).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import (
    Record,
    ends_of,
    function_types,
    read_records,
    refuse_malformed,
    unit_factors,
)
from identification.readers.uff_recordings import Channel, refuse_unequal, takes_of
from identification.words import Dof, InputError, Quantity, Records

_TIME, _FRF = 1, 4
_FORCE, _REACTION = 13, 9
_QUANTITIES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}
_EVEN = 1e-3  # of a step, by which samples may be off their clock


def holds_records(path: Path) -> bool:
    """Whether a universal file has time records and no FRF.

    Raises:
        InputError: missing or truncated.
    """
    types = function_types(path)
    return _TIME in types and _FRF not in types


def read_uff_records(path: Path, quantity: Quantity | None = None) -> tuple[Records, ...]:
    """Read the time records of a universal file, one ``Records`` for each reference.

    Set-ups of other channels with the same reference make ``Records`` of their own. A direction
    or reference of the other sign flips its values to those of the first.

    Args:
        path: the file.
        quantity: what campaign.toml says of motions whose ordinate is of type 0 or 1.

    Raises:
        InputError: with file and record: no force or no motion, ends that are no degree of
            freedom, unequal lengths, rates or quantities.
    """
    records = read_records(path)
    factors = unit_factors(path, records)
    channels = []
    for number, record in records:
        if record.get("type") == 58 and record["func_type"] == _TIME:
            refuse_malformed(f"{path}, record {number}", record)
            channels.append(_channel(path, number, record, factors[number], quantity))
    forces = [channel for channel in channels if channel.quantity is None]
    motions = [channel for channel in channels if channel.quantity is not None]
    if not forces or not motions:
        missing = "motions (ordinate types 8, 11, 12)" if forces else "the force (ordinate type 13)"
        raise InputError(f"{path} holds no time record of {missing}: export all channels together")
    takes = takes_of(path, forces, motions)
    groups: dict[tuple[Dof, tuple[Dof, ...]], list[list[Channel]]] = {}
    for take in takes:
        names = tuple(channel.dof.positive for channel in take[1:])
        groups.setdefault((take[0].dof.positive, names), []).append(take)
    return tuple(_stacked(path, group) for group in groups.values())


def _channel(
    path: Path,
    number: int,
    record: Record,
    factors: tuple[float, float],
    stated: Quantity | None,
) -> Channel:
    name = f"{path}, record {number}"
    if np.iscomplexobj(record["data"]):
        raise InputError(f"{name} is a complex time record: export it as real")
    no_reference = int(record["ref_node"]) == 0 or int(record["ref_dir"]) == 0
    if no_reference:
        record = record | {"ref_node": record["rsp_node"], "ref_dir": record["rsp_dir"]}
    dof, reference = ends_of(path, number, record)
    kind = int(record["ordinate_spec_data_type"])
    quantity = None if kind == _FORCE else _quantity(name, kind, stated)
    length, force = factors
    scale = force if quantity is None else 1.0
    if dof.is_rotation == (quantity is None):
        scale *= length  # a moment, or a translation
    start, rate = _clock(name, record)
    return Channel(
        number,
        int(record["load_case_id"]),
        dof,
        None if no_reference or quantity is None else reference,
        quantity,
        start,
        rate,
        np.asarray(record["data"], np.float64) / scale,
    )


def _quantity(name: str, kind: int, stated: Quantity | None) -> Quantity:
    found = _QUANTITIES.get(kind) or (stated if kind in (0, 1) else None)
    if found and stated and found != stated:
        raise InputError(f"{name} makes {found}, but campaign.toml says {stated}: mend one of them")
    if found is None:
        hint = "a reaction force (9); the hammer's is an excitation force (13)"
        other = f"of ordinate type {kind}, none of force (13) and motion (8, 11, 12)"
        raise InputError(
            f"{name} is {hint if kind == _REACTION else other}: export it with its type, or delete "
            "it"
        )
    return found


def _clock(name: str, record: Record) -> tuple[float, float]:
    """First time [s] and rate [Hz]; the rate that a text of six digits stands for."""
    time = np.asarray(record["x"], np.float64)
    if len(time) < 2:
        raise InputError(f"{name} has a single sample: export the whole record")
    step = (time[-1] - time[0]) / (len(time) - 1)
    if step <= 0 or np.abs(np.diff(time) - step).max() > _EVEN * step + 1e-5 * abs(time[-1]):
        raise InputError(f"{name} is not sampled evenly: resample it")
    even = int(record["abscissa_spacing"]) == 1
    step = float(record["abscissa_inc"]) if even else float(step)
    for digits in range(3):
        rate = round(1.0 / step, digits)
        if rate > 0 and f"{1.0 / rate:.5E}" == f"{step:.5E}":
            return float(time[0]), rate
    return float(time[0]), 1.0 / step


def _stacked(path: Path, takes: list[list[Channel]]) -> Records:
    first = takes[0]
    kinds = {channel.quantity for take in takes for channel in take[1:]} - {None}
    if len(kinds) > 1:
        raise InputError(
            f"{path} mixes records for {' and '.join(sorted(map(str, kinds)))}: give one file for "
            "each"
        )
    for take in takes[1:]:
        refuse_unequal(path, [first[0], replace(take[0], start=first[0].start)])
    values = np.array(
        [
            [c.values * c.dof.sign * head.dof.sign for c, head in zip(take, first, strict=True)]
            for take in takes
        ]
    )
    kind = next(kind for kind in (channel.quantity for channel in first[1:]) if kind)
    try:
        return Records(
            rate_hz=first[0].rate,
            force=values[:, 0],
            motion=values[:, 1:],
            outputs=tuple(channel.dof for channel in first[1:]),
            reference=first[0].dof,
            quantity=kind,
            test=path.name,
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}: export it again") from error
