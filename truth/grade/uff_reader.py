"""Read the universal files that this package writes: FRFs and coherences in datasets 58b.

Small on purpose, and written apart from the writer: 58b little-endian, even lines, single
precision, accelerance in SI units. Anything else is refused with a sentence.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truth.errors import TruthError
from truth.grade.json_reading import read_bytes
from truth.machine.station import Complex, Mask, Real

Channel = tuple[int, int]  # node and signed direction 1, 2, 3

_MAX_BYTES = 2_000_000_000
_MARK = b"    -1\n"
_ASCII_LINES = 11  # of ASCII in front of the data
_FRF_KIND, _COHERENCE_KIND = 4, 6
_TYPES = {_FRF_KIND: (5, "<c8"), _COHERENCE_KIND: (2, "<f4")}  # ordinate data type, its values
_SI = 1


@dataclass(frozen=True, eq=False)
class Measured:
    """FRFs of one file.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        frf: accelerance [m/s2/N]; (n_freq, n_out, n_in), zero where missing.
        coherence: like frf, zero where missing; None if the file has none.
        present: which cells the file has; (n_out, n_in).
        responses, references: rows and columns, in the file's order.
    """

    freq_hz: Real
    frf: Complex
    coherence: Real | None
    present: Mask
    responses: tuple[Channel, ...]
    references: tuple[Channel, ...]


@dataclass(frozen=True, eq=False)
class _Record:
    kind: int
    response: Channel
    reference: Channel
    start: float
    spacing: float
    values: NDArray[np.complex64] | NDArray[np.float32]


def read_uff(path: Path) -> Measured:
    """Read a file of FRFs.

    Raises:
        TruthError: it is missing, no such file, damaged, or holds a record twice.
    """
    content = read_bytes(path, _MAX_BYTES)
    try:
        return _tabulate(_records(content))
    except (ValueError, IndexError) as error:
        raise TruthError(f"{path.name}: is no UFF file of datasets 58b ({error})") from error
    except TruthError as error:
        raise TruthError(f"{path.name}: {error}") from error


def _tabulate(records: list[_Record]) -> Measured:
    """Sort the records into tables; every FRF has its coherence, or none has."""
    frfs = [record for record in records if record.kind == _FRF_KIND]
    if not frfs:
        raise TruthError("holds no FRF")
    first = frfs[0]
    if any(_grid(record) != _grid(first) for record in records):
        raise TruthError("its records have different lines; expected the same")
    responses = tuple(dict.fromkeys(record.response for record in frfs))
    references = tuple(dict.fromkeys(record.reference for record in frfs))
    shape = (first.values.size, len(responses), len(references))
    frf, present = np.zeros(shape, np.complex128), np.zeros(shape[1:], bool)
    coherence, known = np.zeros(shape), np.zeros(shape[1:], bool)
    for record in records:
        is_frf = record.kind == _FRF_KIND
        if record.response not in responses or record.reference not in references:
            continue  # a coherence without its FRF
        cell = responses.index(record.response), references.index(record.reference)
        filled = present if is_frf else known
        if filled[cell]:
            raise TruthError(f"{record.response} from {record.reference} is given twice")
        filled[cell] = True
        (frf if is_frf else coherence)[:, *cell] = record.values
    whole = bool(known[present].all())
    if known.any() and not whole:
        raise TruthError("some FRFs have a coherence, others not")
    freq_hz = first.start + first.spacing * np.arange(shape[0], dtype=np.float64)
    return Measured(freq_hz, frf, coherence if whole else None, present, responses, references)


def _grid(record: _Record) -> tuple[int, float, float]:
    return record.values.size, record.start, record.spacing


def _records(content: bytes) -> list[_Record]:
    """Return the functions of a file; units are checked, other datasets refused."""
    records: list[_Record] = []
    at = 0
    while at < len(content):
        if not content.startswith(_MARK, at):
            raise TruthError(f"byte {at}: expected a line -1 in front of a dataset")
        at += len(_MARK)
        head, body = _line(content, at)
        name = head[:7].strip()
        if name == "58b":
            record, at = _function(content, at)
            records.append(record)
        elif name == "164":
            units, at = _line(content, body)
            if int(units[:10]) != _SI:
                raise TruthError(f"dataset 164: units {units[:10].strip()}; expected SI, 1")
            at = content.index(_MARK, at)
        else:
            raise TruthError(f"dataset {name[:20]}: is not handled; expected 58b and 164")
        if not content.startswith(_MARK, at):
            raise TruthError(f"byte {at}: a dataset is damaged, expected a line -1 behind it")
        at += len(_MARK)
    return records


def _function(content: bytes, at: int) -> tuple[_Record, int]:
    """Return a dataset 58b that starts at a byte, and the byte behind it."""
    lines = []
    for _ in range(_ASCII_LINES + 1):
        line, at = _line(content, at)
        lines.append(line)
    head, place, data = lines[0], lines[6], lines[7]
    if (int(head[7:13]), int(head[13:19]), int(head[19:31])) != (1, 2, _ASCII_LINES):
        raise TruthError("dataset 58b: expected little-endian IEEE numbers behind 11 lines")
    kind, count, size = int(place[:5]), int(data[10:20]), int(head[31:43])
    if kind not in _TYPES or int(data[20:30]) != 1:
        raise TruthError(
            f"dataset 58b: function type {kind}; expected FRF or coherence, even lines"
        )
    number, values = _TYPES[kind]
    if int(data[:10]) != number or size != count * np.dtype(values).itemsize:
        raise TruthError("dataset 58b: expected single precision, and as many bytes as lines need")
    if kind == _FRF_KIND and (int(lines[9][:10]), int(lines[10][:10])) != (12, 13):
        raise TruthError("dataset 58b: an FRF is no acceleration over a force")
    if len(content) < at + size:
        raise TruthError("dataset 58b: the file ends within its data")
    read = np.frombuffer(content, values, count, at)
    if not np.isfinite(read).all():
        raise TruthError("dataset 58b: holds values that are not finite")
    record = _Record(
        kind,
        response=_channel(place[41:51], place[51:55]),
        reference=_channel(place[66:76], place[76:80]),
        start=float(data[30:43]),
        spacing=float(data[43:56]),
        values=read,
    )
    return record, at + size + 1  # a line end behind the data


def _channel(node: str, direction: str) -> Channel:
    if not 1 <= abs(int(direction)) <= 3:
        raise TruthError(f"dataset 58b: direction {direction.strip()}; expected 1, 2, 3, or minus")
    return int(node), int(direction)


def _line(content: bytes, at: int) -> tuple[str, int]:
    """Return the line that starts at a byte, and the byte behind its end."""
    end = content.index(b"\n", at)
    return content[at:end].decode("ascii"), end + 1
