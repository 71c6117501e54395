"""Records of universal files: the datasets that a reader needs, and remarks on the others.

A dataset that a reader needs and that is malformed ends the reading. One that it does not need is
left out with a remark, and so are kinds of datasets that no reader uses.

pyuff 2.5.8 reads the same bits of the 31 files in this repository that both read, in twice the
time. It refuses exponents with D, and reads on without a word where a file is truncated, holds no
dataset or announces a negative number of values.

Datasets of universal files on units and nodes: 164, 15 and 2411.
"""

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

from identification.readers.uff_blocks import (
    Block,
    FieldError,
    locate_blocks,
    parse_number,
    parse_numbers,
)
from identification.readers.uff_function import function_type, read_function
from identification.readers.uff_shapes import read_shape_55, read_shape_2414
from identification.readers.uff_systems import read_systems_18, read_systems_2420
from identification.words import MAX_INPUT_MAGNITUDE, InputError

_NUMBERS_PER_NODE = 7  # number, two coordinate systems, colour, position


def read_units(block: Block) -> dict[str, Any]:
    """Return the unit factors of length and force of a dataset 164.

    Raises:
        ValueError: there are no such numbers.
    """
    length, force, *_ = map(float, parse_numbers(block.lines()[1:]))
    return {"type": block.kind, "length": length, "force": force}


def read_node_table(block: Block) -> dict[str, Any]:
    """Return numbers, coordinate systems and coordinates of the nodes of a dataset 15 or 2411.

    Raises:
        ValueError: a number is malformed or missing.
    """
    fields = [field for line in block.lines() for field in line.split()]
    starts = range(0, len(fields), _NUMBERS_PER_NODE)
    rows = [fields[start : start + _NUMBERS_PER_NODE] for start in starts]
    if len(fields) % _NUMBERS_PER_NODE:
        raise ValueError("a node has other than seven numbers")
    coordinates = np.array([[parse_number(field) for field in row[4:]] for row in rows], float)
    if not (np.abs(coordinates) <= MAX_INPUT_MAGNITUDE).all():
        raise ValueError("a node holds NaN or absurd numbers")
    return {
        "type": block.kind,
        "node_nums": np.array([int(row[0]) for row in rows], np.intp),
        "def_cs": np.array([int(row[1]) for row in rows], np.intp),
        "disp_cs": np.array([int(row[2]) for row in rows], np.intp),
        "coordinates": coordinates.reshape(-1, 3),
    }


_IEEE_FORMAT = 2  # floating-point format of binary data
NODE_DATASETS = (15, 2411)
SYSTEMS_DATASETS = (18, 2420)
UNITS_DATASET, FUNCTION_DATASET = 164, 58
_HEADER_DATASET = 151
_READER_OF_KIND: dict[int, Callable[[Block], dict[str, Any]]] = {
    15: read_node_table,
    18: read_systems_18,
    55: read_shape_55,
    58: read_function,
    164: read_units,
    2411: read_node_table,
    2414: read_shape_2414,
    2420: read_systems_2420,
}
_MAX_NAMED_RECORDS = 5  # in a remark

Record = dict[str, Any]


def read_records(
    path: Path, kinds: Collection[int], functions: Collection[int] = ()
) -> tuple[list[tuple[int, Record]], tuple[str, ...]]:
    """Read the datasets of some kinds, each with its record number.

    Args:
        kinds: numbers of the datasets that are needed.
        functions: function types of datasets 58 that are needed.

    Returns:
        The records, and remarks on datasets that were left out.

    Raises:
        InputError: the file is missing or truncated, or a needed dataset is malformed.
    """
    records: list[tuple[int, Record]] = []
    malformed: dict[int, list[int]] = {}
    foreign: dict[int, list[int]] = {}
    for block in locate_blocks(path):
        is_needed = block.kind in kinds
        if block.kind == FUNCTION_DATASET:
            if not is_needed:
                continue  # a file of many functions takes long to parse
            kind = function_type(block)
            is_needed = is_needed and (kind is None or kind in functions)
        if block.kind not in _READER_OF_KIND:
            if block.kind != _HEADER_DATASET:
                foreign.setdefault(block.kind, []).append(block.number)
            continue
        try:
            record = _READER_OF_KIND[block.kind](block)
        except (ValueError, IndexError, OverflowError) as error:
            if is_needed:
                fault = str(error) if isinstance(error, FieldError) else "cannot be read"
                raise InputError(
                    f"{path}, record {block.number} {fault}: export it again or delete it"
                ) from error
            malformed.setdefault(block.kind, []).append(block.number)
        else:
            if is_needed:
                records.append((block.number, record))
    return records, (
        *_skip_remarks(path, malformed, "malformed and left out: nothing here needs"),
        *_skip_remarks(path, foreign, "left out: no reader uses"),
    )


def _skip_remarks(path: Path, numbers: dict[int, list[int]], reason: str) -> list[str]:
    """Return a remark for each kind of dataset that was left out.

    Args:
        numbers: of the records, by kind of dataset.
        reason: end of the sentence.
    """
    remarks = []
    for kind, records in numbers.items():
        more = len(records) - _MAX_NAMED_RECORDS
        named = ", ".join(map(str, records[:_MAX_NAMED_RECORDS]))
        is_single = len(records) == 1
        remarks.append(
            f"{path.name}: record{'' if is_single else 's'} {named}"
            f"{f' and {more} more' if more > 0 else ''} (dataset {kind or 'without a number'}) "
            f"{'is' if is_single else 'are'} {reason} {'it' if is_single else 'them'}"
        )
    return remarks


def function_types(path: Path) -> set[int]:
    """Read the function types of the datasets 58 and 58b of a file from their headers.

    Raises:
        InputError: the file is missing or truncated.
    """
    blocks = [block for block in locate_blocks(path) if block.kind == FUNCTION_DATASET]
    return {kind for block in blocks if (kind := function_type(block)) is not None}


def unit_factors(path: Path, records: list[tuple[int, Record]]) -> dict[int, tuple[float, float]]:
    """Return the unit factors of length and force for each record.

    They come from the last dataset 164 before the record, else from the first one of the file, and
    are 1 without any. A value divided by its factor is in SI units.

    Raises:
        InputError: a factor is not a positive number.
    """
    factors = {
        number: (float(record["length"]), float(record["force"]))
        for number, record in records
        if record["type"] == UNITS_DATASET
    }
    for number, pair in factors.items():
        if not all(np.isfinite(factor) and factor > 0 for factor in pair):
            raise InputError(
                f"{path}, record {number}: unit factors {pair} are not positive numbers: "
                "correct them"
            )
    current = next(iter(factors.values()), (1.0, 1.0))
    of_records = {}
    for number, _ in records:
        current = factors.get(number, current)
        of_records[number] = current
    return of_records


def refuse_malformed(name: str, record: Record) -> None:
    """Refuse a dataset 58 whose values are missing, not finite or of an unknown form.

    Args:
        name: file and record, for messages.

    Raises:
        InputError: the dataset cannot be used.
    """
    if record.get("binary") and int(record.get("fp_format", _IEEE_FORMAT)) != _IEEE_FORMAT:
        raise InputError(f"{name} is not in IEEE floating point: export it as IEEE or ASCII")
    if "x" not in record or "data" not in record:
        raise InputError(f"{name} has data of an unknown form: export it as form 2, 4, 5 or 6")
    values, count = len(record["data"]), int(record["num_pts"])
    if values != count or len(record["x"]) != count or not count:
        raise InputError(
            f"{name} announces {count} values but holds {values}: it is truncated; export it again"
        )
    if not all((np.abs(record[key]) <= MAX_INPUT_MAGNITUDE).all() for key in ("x", "data")):
        raise InputError(
            f"{name} (node {record['rsp_node']}) holds NaN or infinity: export it again or delete "
            "the record"
        )
