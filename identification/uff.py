"""Universal files in: FRFs and coherences of dataset 58 and 58b, units of dataset 164, by pyuff.

pyuff drops a dataset without an end and trusts the byte count of a 58b; so the blocks are walked
here first, and whatever does not add up is refused with the number of its record. Records are
counted from 1, all datasets of the file together.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from identification.table import FrfTable
from identification.words import Dof, InputError, Quantity

_FRF, _COHERENCE = 4, 6
_QUANTITIES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}
_MARK = re.compile(rb"[ ]{4}-1[ ]*(\r?\n|$)")
_HEADER_LINES = 11

Record = dict[str, Any]


def read_uff(path: Path, quantity: Quantity | None = None) -> FrfTable:
    """Read the FRFs and coherences of a universal file.

    Args:
        path: the file.
        quantity: for records whose ordinate type is 0 (unknown).

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
        table[:, *cell] = sign * record["data"] * _to_si(factors, response, reference)
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
    count = sum(1 for _ in _blocks(path, path.read_bytes()))
    if not count:
        raise InputError(f"{path} holds no dataset: a universal file has lines of -1 around each")
    file = pyuff.UFF(str(path))
    if file.get_n_sets() != count:
        raise InputError(
            f"{path}: {count} datasets were counted and {file.get_n_sets()} found: the binary data "
            "of one look like an end mark; export it as ASCII"
        )
    records = []
    for number in range(count):
        try:
            records.append((number + 1, file.read_sets(number)))
        except Exception as error:  # pyuff raises bare Exceptions of its own
            raise InputError(
                f"{path}, record {number + 1} cannot be read: export it again, or delete it"
            ) from error
    return records


def _blocks(path: Path, content: bytes) -> Iterator[int]:
    """Offsets of the datasets, each proven to have its end mark and the bytes it announces."""
    position, number = 0, 0
    while match := _MARK.search(content, position):
        number += 1
        start = match.end()
        header = content[start : start + 80].split(b"\n")[0]
        data = start
        if header[:7].strip().lower() == b"58b":
            try:
                announced = int(header[31:43])
            except ValueError as error:
                raise InputError(
                    f"{path}, record {number}: the 58b header does not say how many bytes follow"
                ) from error
            for _ in range(_HEADER_LINES + 1):
                data = content.find(b"\n", data) + 1
            if not data or len(content) < data + announced:
                raise InputError(
                    f"{path}, record {number} is truncated: {announced} bytes were announced, "
                    f"{max(0, len(content) - data)} are there; copy or export the file again"
                )
            data += announced
        end = _MARK.search(content, data)
        if end is None:
            raise InputError(
                f"{path}, record {number} has no end mark: the file is truncated; copy it again"
            )
        if header[:7].strip().lower() == b"58b" and content[data : end.start()].strip():
            raise InputError(
                f"{path}, record {number}: more bytes follow than the 58b header announces; "
                "export it again"
            )
        yield start
        position = end.end()
    if content[position:].strip():
        raise InputError(f"{path} ends with something that is no dataset after record {number}")


def _unit_factors(path: Path, records: list[tuple[int, Record]]) -> tuple[float, float]:
    """Length and force of dataset 164: SI = value / factor."""
    factors = (1.0, 1.0)
    for number, record in records:
        if record.get("type") == 164:
            factors = (float(record["length"]), float(record["force"]))
            if not all(np.isfinite(f) and f > 0 for f in factors):
                raise InputError(f"{path}, record {number}: unit factors {factors} are no factors")
    return factors


def _to_si(factors: tuple[float, float], response: Dof, reference: Dof) -> float:
    length, force = factors
    numerator = 1.0 if response.is_rotation else length
    denominator = force * length if reference.is_rotation else force
    return denominator / numerator


def _common_axis(path: Path, functions: list[tuple[int, Record]]) -> np.ndarray:
    first_number, first = functions[0]
    axis = np.asarray(first["x"], float)
    if axis.size == 0 or not (np.diff(axis) > 0).all():
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
        if not (np.isfinite(other).all() and np.isfinite(record["data"]).all()):
            raise InputError(
                f"{path}, record {number} (node {record['rsp_node']}) holds NaN or infinity: "
                "export it again or delete the record"
            )
        if len(record["data"]) != len(axis):
            raise InputError(
                f"{path}, record {number}: {len(record['data'])} values for {len(axis)} "
                "frequencies: the record is truncated"
            )
    return axis


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


def _quantity(path: Path, number: int, record: Record, fallback: Quantity | None) -> Quantity:
    kind = int(record["ordinate_spec_data_type"])
    found = _QUANTITIES.get(kind) or (fallback if kind in (0, 1) else None)
    if found is None:
        raise InputError(
            f"{path}, record {number}: ordinate type {kind} is none of displacement (8), "
            'velocity (11), acceleration (12): state quantity = "accelerance" in campaign.toml'
        )
    return found
