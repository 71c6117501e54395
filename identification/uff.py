"""Universal files in: FRFs and coherences of dataset 58 and 58b, units of dataset 164, by pyuff.

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

from identification.table import FrfTable
from identification.words import Dof, InputError, Quantity

_FRF, _COHERENCE = 4, 6
_QUANTITIES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}
_MARK = re.compile(rb"(?m)^[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_BINARY_MARK = re.compile(rb"\s*?[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_BYTES = {2: 4, 4: 8, 5: 8, 6: 16}  # of a value on an even axis, by its form
_IEEE = 2
_HEADER_LINES = 11

Record = dict[str, Any]


def read_uff(path: Path, quantity: Quantity | None = None) -> FrfTable:
    """Read the FRFs and coherences of a universal file.

    Args:
        path: the file.
        quantity: what campaign.toml says; needed where the ordinate's type is 0 (unknown).

    Raises:
        InputError: with file and record: missing file, truncated or malformed record, NaN,
            unequal axes, a scalar direction, two records with one response and reference,
            no FRF at all.
    """
    records = _read_records(path)
    factors = _unit_factors(path, records)
    functions = [
        (number, record)
        for number, record in records
        if record.get("type") == 58 and record["func_type"] in (_FRF, _COHERENCE)
    ]
    frfs = [item for item in functions if item[1]["func_type"] == _FRF]
    if not frfs:
        raise InputError(f"{path} holds no FRF (dataset 58, function type 4): export FRFs")
    freq_hz = _common_axis(path, functions)
    responses, references = _labels(path, frfs)
    table = np.zeros((len(freq_hz), len(responses), len(references)), complex)
    coherence = np.full(table.shape, np.nan)
    seen: dict[tuple[int, int, int], int] = {}
    kinds = set()
    for number, record in functions:
        response, reference = _ends(path, number, record)
        if response.positive not in responses or reference.positive not in references:
            continue  # a coherence without its FRF
        cell = responses[response.positive][0], references[reference.positive][0]
        _refuse_second(path, seen, (record["func_type"], *cell), number, f"{response}, {reference}")
        if record["func_type"] == _COHERENCE:
            coherence[:, *cell] = np.clip(np.real(record["data"]), 0.0, 1.0)
            continue
        kinds.add(_quantity(path, number, record, quantity))
        sign = responses[response.positive][1] * response.sign
        sign *= references[reference.positive][1] * reference.sign
        table[:, *cell] = sign * record["data"] * _to_si(factors[number], response, reference)
    if len(kinds) > 1:
        raise InputError(f"{path} mixes {' and '.join(sorted(kinds))}: give one file for each")
    measured = np.zeros(table.shape[1:], bool)
    for kind, row, column in seen:
        measured[row, column] |= kind == _FRF
    complete = np.isfinite(coherence[:, measured]).all()
    return FrfTable(
        freq_hz=freq_hz,
        values=table,
        coherence=np.nan_to_num(coherence) if complete else None,
        measured=measured,
        responses=tuple(Dof.of(d.point, d.axis, sign) for d, (_, sign) in responses.items()),
        references=tuple(Dof.of(d.point, d.axis, sign) for d, (_, sign) in references.items()),
        quantity=kinds.pop(),
    )


def _read_records(path: Path) -> list[tuple[int, Record]]:
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


def _unit_factors(path: Path, records: list[tuple[int, Record]]) -> dict[int, tuple[float, float]]:
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


def _to_si(factors: tuple[float, float], response: Dof, reference: Dof) -> float:
    length, force = factors
    numerator = 1.0 if response.is_rotation else length
    denominator = force * length if reference.is_rotation else force
    return denominator / numerator


def _common_axis(path: Path, functions: list[tuple[int, Record]]) -> np.ndarray:
    for number, record in functions:
        _refuse_malformed(f"{path}, record {number}", record)
    first_number, first = functions[0]
    axis = np.asarray(first["x"], float)
    if not (np.diff(axis) > 0).all():
        raise InputError(
            f"{path}, record {first_number}: its frequencies do not rise; export again"
        )
    spacing = np.diff(axis).min() if axis.size > 1 else 1.0
    for number, record in functions:
        other = np.asarray(record["x"], float)
        if other.shape != axis.shape or np.abs(other - axis).max() > 1e-3 * spacing:
            raise InputError(
                f"{path}: records {first_number} and {number} have unequal frequency axes "
                f"({_span(axis)}; {_span(other)}): export all records with one axis"
            )
    return axis


def _refuse_malformed(name: str, record: Record) -> None:
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


def _span(axis: np.ndarray) -> str:
    return f"{axis.size} lines {axis[0]:g}..{axis[-1]:g} Hz"


def _ends(path: Path, number: int, record: Record) -> tuple[Dof, Dof]:
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


def _labels(
    path: Path, frfs: list[tuple[int, Record]]
) -> tuple[dict[Dof, tuple[int, int]], dict[Dof, tuple[int, int]]]:
    """Position and first sign of every response and reference, in order of appearance."""
    responses: dict[Dof, tuple[int, int]] = {}
    references: dict[Dof, tuple[int, int]] = {}
    for number, record in frfs:
        response, reference = _ends(path, number, record)
        responses.setdefault(response.positive, (len(responses), response.sign))
        references.setdefault(reference.positive, (len(references), reference.sign))
    return responses, references


def _refuse_second(
    path: Path,
    seen: dict[tuple[int, int, int], int],
    key: tuple[int, int, int],
    number: int,
    dofs: str,
) -> None:
    first = seen.setdefault(key, number)
    if first != number:
        raise InputError(
            f"{path}: records {first} and {number} have one response and reference ({dofs}): "
            "delete one, or put them into files of their own"
        )


def _quantity(path: Path, number: int, record: Record, stated: Quantity | None) -> Quantity:
    kind = int(record["ordinate_spec_data_type"])
    if int(record["orddenom_spec_data_type"]) in _QUANTITIES:
        raise InputError(
            f"{path}, record {number} is motion per motion, a transmissibility: export FRFs per "
            "force"
        )
    found = _QUANTITIES.get(kind) or (stated if kind in (0, 1) else None)
    if found and stated and found != stated:
        raise InputError(
            f"{path}, record {number} is {found}, but campaign.toml says {stated}: mend one of them"
        )
    if found is None:
        raise InputError(
            f"{path}, record {number}: ordinate type {kind} is none of displacement (8), "
            'velocity (11), acceleration (12): state quantity = "accelerance" in campaign.toml'
        )
    return found
