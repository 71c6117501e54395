"""Universal files in: datasets 58 and 58b, nodes, units (dataset 164), by pyuff.

pyuff drops a dataset without an end and trusts the byte count of a 58b; so the blocks are walked
here first, and whatever does not add up is refused with the number of its record. Records are
counted from 1, all datasets of the file together.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from identification.words import Dof, InputError, Real

_MARK = re.compile(rb"(?m)^[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_BINARY_MARK = re.compile(rb"\s*?[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_BYTES = {2: 4, 4: 8, 5: 8, 6: 16}  # of a value on an even axis, by its form
_IEEE = 2
_HEADER_LINES = 11
_NODES = (15, 2411)
_FUNCTION, _FUNCTION_LINE = 58, 7  # dataset, and its line with the type, the mark counted as 0

Record = dict[str, Any]


def read_records(path: Path) -> list[tuple[int, Record]]:
    """Read all datasets of a file, each with its number.

    Raises:
        InputError: missing, truncated or malformed.
    """
    if not path.is_file():
        raise InputError(f"{path} does not exist: name the UFF file of the test")
    blocks = list(_blocks(path, path.read_bytes()))
    if not blocks:
        raise InputError(f"{path} holds no dataset: a universal file has lines of -1 around each")
    file = pyuff.UFF(str(path))
    # pyuff's own index trusts every line that looks like a mark, binary data included.
    file._n_sets = len(blocks)
    file._block_ind = np.array([(block.start, block.end) for block in blocks])
    file._set_types = np.array([block.kind for block in blocks])
    file._set_formats = np.array([float(block.is_binary) for block in blocks])
    records = []
    for number in range(len(blocks)):
        try:
            records.append((number + 1, file.read_sets(number)))
        except Exception as error:  # pyuff raises bare Exceptions of its own
            raise InputError(
                f"{path}, record {number + 1} cannot be read: export it again, or delete it"
            ) from error
    return records


def function_types(path: Path) -> set[int]:
    """Function types of the datasets 58 and 58b of a file, from their headers alone.

    Raises:
        InputError: missing or truncated.
    """
    if not path.is_file():
        raise InputError(f"{path} does not exist: name the UFF file of the test")
    content = path.read_bytes()
    found = set()
    for block in _blocks(path, content):
        if block.kind == _FUNCTION:
            lines = content[block.start : block.end].split(b"\n", _FUNCTION_LINE + 1)
            text = lines[_FUNCTION_LINE][:5].strip() if len(lines) > _FUNCTION_LINE else b""
            found |= {int(text)} if text.isdigit() else set()
    return found


@dataclass(frozen=True)
class _Block:
    """One dataset: offsets of its first mark and of the last byte before its end mark."""

    start: int
    end: int
    kind: int
    is_binary: bool


def _blocks(path: Path, content: bytes) -> Iterator[_Block]:
    """Walk the datasets, each proven to have its end mark and the bytes it announces."""
    position, number = 0, 0
    while match := _MARK.search(content, position):
        number += 1
        name = f"{path}, record {number}"
        start = match.end()
        header = content[start : start + 80].split(b"\n")[0]
        is_binary = header[:7].strip().lower() == b"58b"
        end = _end_of_binary(name, content, start) if is_binary else _MARK.search(content, start)
        if end is None:
            raise InputError(f"{name} has no end mark: the file is truncated; copy it again")
        kind = int(header[:6]) if header[:6].strip().isdigit() else 0
        yield _Block(match.start(), end.start() - 1, kind, is_binary)
        position = end.end()
    if content[position:].strip():
        raise InputError(f"{path} ends with something that is no dataset after record {number}")


def _end_of_binary(name: str, content: bytes, start: int) -> re.Match[bytes]:
    """The end mark behind the data of a 58b.

    It stands where the header's count of bytes ends; some writers miscount complex data, so where
    the number and size of the values end counts too.
    """
    lines, data = [], start
    for _ in range(_HEADER_LINES + 1):
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
            f"{name}: the 58b header does not say how many bytes and values follow: export it again"
        ) from error
    for size in (announced, values * _BYTES.get(form, 0)):
        if size and (end := _BINARY_MARK.match(content, data + size)):
            return end
    there = len(content) - data
    if there < announced:
        raise InputError(
            f"{name} is truncated: {announced} bytes were announced, {there} are there; copy or "
            "export the file again"
        )
    raise InputError(
        f"{name}: no end mark stands where the {announced} bytes that the 58b header announces "
        "end: the file is truncated or miscounted; export it again"
    )


def unit_factors(path: Path, records: list[tuple[int, Record]]) -> dict[int, tuple[float, float]]:
    """Length and force for each record, of the dataset 164 before it, else of the first one."""
    stated = {
        number: (float(record["length"]), float(record["force"]))
        for number, record in records
        if record.get("type") == 164
    }
    for number, factors in stated.items():
        if not all(np.isfinite(factor) and factor > 0 for factor in factors):
            raise InputError(f"{path}, record {number}: unit factors {factors} are no factors")
    current = next(iter(stated.values()), (1.0, 1.0))
    found = {}
    for number, _ in records:
        current = stated.get(number, current)
        found[number] = current
    return found


@dataclass(frozen=True, eq=False)
class Node:
    """A node of a dataset 15 or 2411.

    Args:
        record: number of its dataset.
        number: its own.
        system: number of the coordinate system that it moves in.
        place: [m]; (3,).
    """

    record: int
    number: int
    system: int
    place: Real


def nodes_of(path: Path, records: list[tuple[int, Record]]) -> list[Node]:
    """All nodes in the order of the file: of two with one number the later holds.

    Raises:
        InputError: unit factors that are none.
    """
    factors = unit_factors(path, records)
    return [
        Node(record, int(number), int(system), np.array(place, float) / factors[record][0])
        for record, content in records
        if content.get("type") in _NODES
        for number, system, *place in zip(
            *(content[key] for key in ("node_nums", "disp_cs", "x", "y", "z")), strict=True
        )
    ]


def refuse_malformed(name: str, record: Record) -> None:
    """Refuse a dataset 58 whose values are not all there.

    Raises:
        InputError: with its name.
    """
    if record.get("binary") and int(record.get("fp_format", _IEEE)) != _IEEE:
        raise InputError(f"{name} is not in IEEE floating point: export it as IEEE or ASCII")
    if "x" not in record or "data" not in record:
        raise InputError(f"{name} has data of an unknown form: export it as form 2, 4, 5 or 6")
    values, count = len(record["data"]), int(record["num_pts"])
    if values != count or len(record["x"]) != count or not count:
        raise InputError(
            f"{name} announces {count} values and holds {values}: it is truncated; export it again"
        )
    if not (np.isfinite(record["x"]).all() and np.isfinite(record["data"]).all()):
        raise InputError(
            f"{name} (node {record['rsp_node']}) holds NaN or infinity: export it again or delete "
            "the record"
        )


def ends_of(path: Path, number: int, record: Record) -> tuple[Dof, Dof]:
    """Response and reference of a dataset 58, points by node number.

    Raises:
        InputError: a direction that is none.
    """
    ends = []
    for end, name in (("rsp", "response"), ("ref", "reference")):
        direction = int(record[f"{end}_dir"])
        if not 1 <= abs(direction) <= 6:
            raise InputError(
                f"{path}, record {number}: {name} direction {direction} is none of +-1..6: "
                "give the channel a direction"
            )
        ends.append(Dof.of(str(int(record[f"{end}_node"])), abs(direction) - 1, direction))
    return ends[0], ends[1]
