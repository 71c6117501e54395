"""Datasets of universal files: functions (58, 58b), nodes (15, 2411) and units (164), by pyuff.

pyuff ignores a dataset without an end mark and trusts the byte count of a 58b. This module
therefore locates all datasets itself and refuses inconsistent ones with the number of the record.
Records are the datasets of the file, counted from 1.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from identification.words import Dof, InputError, Real
from identification.words.file_access import read_bytes

# A line of -1 begins and ends each dataset.
_DATASET_MARK = re.compile(rb"(?m)^[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_BINARY_END_MARK = re.compile(rb"\s*?[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_BYTES_PER_VALUE = {2: 4, 4: 8, 5: 8, 6: 16}  # on an evenly spaced axis, by ordinate data form
_IEEE_FORMAT = 2  # floating-point format of binary data
_HEADER_LINES_58B = 11  # after the line with the number of the dataset
_NODE_DATASETS = (15, 2411)
UNITS_DATASET = 164
_FUNCTION_DATASET = 58
_FUNCTION_TYPE_LINE = 7  # line of a dataset 58 with the function type; the mark is line 0

Record = dict[str, Any]


def read_records(path: Path) -> list[tuple[int, Record]]:
    """Read all datasets of a file, each with its record number.

    Raises:
        InputError: the file is missing, truncated or malformed.
    """
    content = read_bytes(path, "name the UFF file of the test")
    blocks = list(_locate_blocks(path, content))
    if not blocks:
        raise InputError(f"{path} holds no dataset between lines of -1: name a universal file")
    file = pyuff.UFF(str(path))
    # The index of pyuff trusts every line that looks like a mark, even in binary data.
    file._n_sets = len(blocks)
    file._block_ind = np.array([(block.start, block.end) for block in blocks])
    file._set_types = np.array([block.kind for block in blocks])
    file._set_formats = np.array([float(block.is_binary) for block in blocks])
    records = []
    for number in range(len(blocks)):
        try:
            records.append((number + 1, file.read_sets(number)))
        except Exception as error:  # pyuff raises bare Exceptions
            raise InputError(
                f"{path}, record {number + 1} cannot be read: export it again or delete it"
            ) from error
    return records


def function_types(path: Path) -> set[int]:
    """Read the function types of the datasets 58 and 58b of a file from their headers.

    Raises:
        InputError: the file is missing or truncated.
    """
    content = read_bytes(path, "name the UFF file of the test")
    types = set()
    for block in _locate_blocks(path, content):
        if block.kind == _FUNCTION_DATASET:
            lines = content[block.start : block.end].split(b"\n", _FUNCTION_TYPE_LINE + 1)
            is_complete = len(lines) > _FUNCTION_TYPE_LINE
            text = lines[_FUNCTION_TYPE_LINE][:5].strip() if is_complete else b""
            types |= {int(text)} if text.isdigit() else set()
    return types


@dataclass(frozen=True)
class _Block:
    """Location of one dataset: offsets of its first mark and of the byte before its end mark."""

    start: int
    end: int
    kind: int
    is_binary: bool


def _locate_blocks(path: Path, content: bytes) -> Iterator[_Block]:
    """Yield the datasets, each checked for its end mark and the bytes that it announces."""
    position, number = 0, 0
    while match := _DATASET_MARK.search(content, position):
        number += 1
        name = f"{path}, record {number}"
        start = match.end()
        header = content[start : start + 80].split(b"\n")[0]
        is_binary = header[:7].strip().lower() == b"58b"
        end = (
            _end_of_binary(name, content, start)
            if is_binary
            else _DATASET_MARK.search(content, start)
        )
        if end is None:
            raise InputError(f"{name} has no end mark: the file is truncated; copy it again")
        kind = int(header[:6]) if header[:6].strip().isdigit() else 0
        yield _Block(match.start(), end.start() - 1, kind, is_binary)
        position = end.end()
    if content[position:].strip():
        raise InputError(f"{path} holds text after record {number} that is no dataset: remove it")


def _end_of_binary(name: str, content: bytes, start: int) -> re.Match[bytes]:
    """Return the end mark after the data of a dataset 58b.

    It follows the number of bytes that the header announces. Some writers miscount complex data,
    so the number and size of the values is accepted too.
    """
    lines, data = [], start
    for _ in range(_HEADER_LINES_58B + 1):
        stop = content.find(b"\n", data) + 1
        if not stop:
            raise InputError(f"{name} is truncated in its header: copy or export the file again")
        lines.append(content[data:stop])
        data = stop
    try:
        announced = int(lines[0][31:43])
        form, values = int(lines[7][:10]), int(lines[7][10:20])
    except ValueError as error:
        raise InputError(
            f"{name}: the 58b header lacks the number of bytes and values: export it again"
        ) from error
    for size in (announced, values * _BYTES_PER_VALUE.get(form, 0)):
        if size and (end := _BINARY_END_MARK.match(content, data + size)):
            return end
    available = len(content) - data
    if available < announced:
        raise InputError(
            f"{name} is truncated: its header announces {announced} bytes, but {available} follow; "
            "copy or export the file again"
        )
    raise InputError(
        f"{name}: no end mark follows the {announced} bytes that the 58b header announces: "
        "the file is truncated or miscounted; export it again"
    )


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
        if record.get("type") == UNITS_DATASET
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


@dataclass(frozen=True, eq=False)
class Node:
    """Node of a dataset 15 or 2411.

    Args:
        record: number of the record that holds the node.
        number: number of the node.
        system: number of the coordinate system of its displacements.
        position: position [m]; (3,).
    """

    record: int
    number: int
    system: int
    position: Real


def read_nodes(path: Path, records: list[tuple[int, Record]]) -> list[Node]:
    """Extract all nodes from the records, in the order of the file.

    If a node number appears twice, the later node counts.

    Raises:
        InputError: a unit factor is not a positive number.
    """
    factors = unit_factors(path, records)
    return [
        Node(record, int(number), int(system), np.array(position, float) / factors[record][0])
        for record, content in records
        if content.get("type") in _NODE_DATASETS
        for number, system, *position in zip(
            *(content[key] for key in ("node_nums", "disp_cs", "x", "y", "z")), strict=True
        )
    ]


def refuse_malformed(name: str, record: Record) -> None:
    """Refuse a dataset 58 whose values are missing, not finite or of an unknown form.

    Args:
        name: file and record, for messages.
        record: content of the dataset.

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
    if not (np.isfinite(record["x"]).all() and np.isfinite(record["data"]).all()):
        raise InputError(
            f"{name} (node {record['rsp_node']}) holds NaN or infinity: export it again or delete "
            "the record"
        )


def response_and_reference(path: Path, number: int, record: Record) -> tuple[Dof, Dof]:
    """Return response and reference of a dataset 58, with points named by node number.

    Raises:
        InputError: a direction is none of +-1..6.
    """
    dofs = []
    for prefix, name in (("rsp", "response"), ("ref", "reference")):
        direction = int(record[f"{prefix}_dir"])
        if not 1 <= abs(direction) <= 6:
            raise InputError(
                f"{path}, record {number}: {name} direction {direction} is none of +-1..6: "
                "give the channel a direction"
            )
        dofs.append(Dof.of(str(int(record[f"{prefix}_node"])), abs(direction) - 1, direction))
    return dofs[0], dofs[1]
