"""Time records of universal files: function type 1 of datasets 58 and 58b.

The force is the channel with the ordinate type excitation force (13). Motions have the types
displacement (8), velocity (11) and acceleration (12).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import (
    FUNCTION_DATASET,
    UNITS_DATASET,
    Record,
    function_types,
    read_records,
    refuse_malformed,
    unit_factors,
)
from identification.readers.uff_directions import StatedDirections
from identification.readers.uff_frfs import FRF_TYPE, QUANTITY_OF_ORDINATE
from identification.readers.uff_recordings import (
    Channel,
    find_recordings_at_once,
    group_recordings,
    refuse_unequal,
)
from identification.readers.uff_units import UnitConverter
from identification.words import InputError, Quantity, Records, group_by_key

_TIME_TYPE = 1  # function type
_EXCITATION_FORCE, _REACTION_FORCE = 13, 9  # ordinate types
# Samples may lie off an even axis by this part of a step, and by the rounding of six digits.
_MAX_STEP_DEVIATION, _DIGIT_ROUNDING = 1e-3, 1e-5


def holds_uff_time_records(path: Path) -> bool:
    """Return whether a universal file has time records and no FRFs.

    Raises:
        InputError: the file is missing or truncated.
    """
    types = function_types(path)
    return _TIME_TYPE in types and FRF_TYPE not in types


def read_uff_records(
    path: Path,
    quantity: Quantity | None = None,
    unit: str | None = None,
    *,
    channels: str | list[str] | None = None,
    references: list[str] | None = None,
) -> tuple[Records, ...]:
    """Read the time records of a universal file, one ``Records`` for each reference.

    Where a load case has several forces, motions without a reference, and as many records of each,
    the forces acted at once. Set-ups with one reference but different channels become separate
    ``Records``. Values whose direction has the opposite sign in a later recording are negated.

    Args:
        quantity: quantity that campaign.toml states, which overrides the file; needed for motions
            with ordinate type 0 or 1.
        unit: unit of motion over force that campaign.toml states, which overrides the file.
        channels: motions that campaign.toml states, for scalar records.
        references: forces that campaign.toml states, for scalar records.

    Raises:
        InputError: force or motions are missing, a direction is invalid, or lengths, rates or
            quantities differ. The message names file and record.
    """
    records, remarks = read_records(path, (FUNCTION_DATASET, UNITS_DATASET), (_TIME_TYPE,))
    factors = unit_factors(path, records)
    directions = StatedDirections.parse(path, channels, references)
    has_units = any(record["type"] == UNITS_DATASET for _, record in records)
    converter = UnitConverter(path, unit, has_units)
    rows = []
    for number, record in records:
        if record["type"] == FUNCTION_DATASET:
            refuse_malformed(f"{path}, record {number}", record)
            rows.append(
                _channel(directions, converter, (number, record), factors[number], quantity)
            )
    directions.refuse_unused()
    forces = [channel for channel in rows if channel.quantity is None]
    motions = [channel for channel in rows if channel.quantity is not None]
    if not forces or not motions:
        missing = "motions (ordinate types 8, 11, 12)" if forces else "the force (ordinate type 13)"
        raise InputError(f"{path} holds no time record of {missing}: export all channels together")
    at_once = find_recordings_at_once(forces, motions)
    cases = {case for case, _ in at_once}
    alone = [[c for c in channels if c.case not in cases] for channels in (forces, motions)]
    recordings = group_recordings(path, *alone) if alone[0] or alone[1] else []
    groups = group_by_key(
        (tuple(channel.dof.positive for channel in recording), recording)
        for recording in recordings
    )
    stacks = [_stack_recordings(path, group) for group in groups.values()]
    stacks += _stack_forces_at_once(path, list(at_once.values()))
    remarks = (*remarks, *converter.remarks)
    return tuple(replace(records, remarks=remarks) for records in stacks)


def _stack_forces_at_once(path: Path, recordings: list[list[Channel]]) -> list[Records]:
    """Return records of each of several forces, with the others beside it."""
    for channels in recordings:
        refuse_unequal(path, channels)
    of_force = group_by_key(
        (head.dof.positive, [head, *(each for each in channels if each.quantity is not None)])
        for channels in recordings
        for head in channels
        if head.quantity is None
    )
    if len({len(rows) for rows in of_force.values()}) > 1:
        raise InputError(
            f"{path}: forces that act at once are at other points in some load cases: give one "
            "file for each set of forces"
        )
    stacks = [_stack_recordings(path, rows) for rows in of_force.values()]
    return [
        replace(
            records,
            further_forces=np.stack([s.force for s in stacks if s is not records]),
            further_references=tuple(s.reference for s in stacks if s is not records),
        )
        for records in stacks
    ]


def _channel(
    directions: StatedDirections,
    converter: UnitConverter,
    item: tuple[int, Record],
    factors: tuple[float, float],
    expected: Quantity | None,
) -> Channel:
    """Convert a record to a channel in SI units."""
    number, record = item
    name = f"{directions.path}, record {number}"
    if np.iscomplexobj(record["data"]):
        raise InputError(f"{name} is a complex time record: export it as real")
    kind = int(record["ordinate_spec_data_type"])
    quantity = None if kind == _EXCITATION_FORCE else _quantity(name, kind, expected, converter)
    key = "reference" if quantity is None else "response"
    dof = directions.read_dof(number, record, "response", stated=key)
    has_reference = quantity is not None and record["ref_node"] and record["ref_dir"]
    factor = converter.channel_factor(record, quantity, factors, dof)
    start, rate = _clock(name, record)
    return Channel(
        number,
        int(record["load_case_id"]),
        dof,
        directions.read_dof(number, record, "reference") if has_reference else None,
        quantity,
        start,
        rate,
        np.asarray(record["data"], np.float64) * factor,
    )


def _quantity(
    name: str, kind: int, expected: Quantity | None, converter: UnitConverter
) -> Quantity:
    """Return the quantity of a motion's FRFs; the stated one overrides the file, with a remark."""
    quantity = QUANTITY_OF_ORDINATE.get(kind) or (expected if kind in (0, 1) else None)
    if quantity and expected and quantity != expected:
        converter.remark(
            f'quantity = "{expected}" of campaign.toml overrides {quantity}, which the file names'
        )
        return expected
    if quantity is None:
        reaction = "a reaction force (9), but the hammer needs an excitation force (13)"
        unknown = f"of ordinate type {kind}, which is neither force (13) nor motion (8, 11, 12)"
        raise InputError(
            f"{name} is {reaction if kind == _REACTION_FORCE else unknown}: export it with its "
            "type, or delete it"
        )
    return quantity


def _clock(name: str, record: Record) -> tuple[float, float]:
    """Return the first time [s] and the sampling rate [Hz].

    The rate has at most two decimals if its step has the six digits of the file.
    """
    time = np.asarray(record["x"], np.float64)
    if len(time) < 2:
        raise InputError(f"{name} has a single sample: export the whole record")
    step = (time[-1] - time[0]) / (len(time) - 1)
    if step <= 0 or np.abs(np.diff(time) - step).max() > (
        _MAX_STEP_DEVIATION * step + _DIGIT_ROUNDING * abs(time[-1])
    ):
        raise InputError(f"{name} is not sampled evenly: resample it")
    even = int(record["abscissa_spacing"]) == 1
    step = float(record["abscissa_inc"]) if even else float(step)
    for digits in range(3):
        rate = round(1.0 / step, digits)
        if rate > 0 and f"{1.0 / rate:.5E}" == f"{step:.5E}":
            return float(time[0]), rate
    return float(time[0]), 1.0 / step


def _stack_recordings(path: Path, recordings: list[list[Channel]]) -> Records:
    """Stack recordings with one reference and the same channels into ``Records``."""
    first = recordings[0]
    kinds = {channel.quantity for recording in recordings for channel in recording[1:]} - {None}
    if len(kinds) > 1:
        raise InputError(
            f"{path} mixes records for {' and '.join(sorted(map(str, kinds)))}: give one file for "
            "each"
        )
    for recording in recordings[1:]:
        refuse_unequal(path, [first[0], replace(recording[0], start=first[0].start)])
    values = np.array(
        [
            [
                c.values * c.dof.sign * head.dof.sign
                for c, head in zip(recording, first, strict=True)
            ]
            for recording in recordings
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
