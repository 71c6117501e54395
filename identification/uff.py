"""FRFs and coherences of a universal file: function types 4 and 6 of dataset 58 and 58b."""

from pathlib import Path

import numpy as np

from identification.table import FrfTable
from identification.uff_file import Record, ends_of, read_records, refuse_malformed, unit_factors
from identification.words import Dof, InputError, Quantity

_FRF, _COHERENCE = 4, 6
_QUANTITIES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}


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
    records = read_records(path)
    factors = unit_factors(path, records)
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
        response, reference = ends_of(path, number, record)
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


def _to_si(factors: tuple[float, float], response: Dof, reference: Dof) -> float:
    length, force = factors
    numerator = 1.0 if response.is_rotation else length
    denominator = force * length if reference.is_rotation else force
    return denominator / numerator


def _common_axis(path: Path, functions: list[tuple[int, Record]]) -> np.ndarray:
    for number, record in functions:
        refuse_malformed(f"{path}, record {number}", record)
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


def _span(axis: np.ndarray) -> str:
    return f"{axis.size} lines {axis[0]:g}..{axis[-1]:g} Hz"


def _labels(
    path: Path, frfs: list[tuple[int, Record]]
) -> tuple[dict[Dof, tuple[int, int]], dict[Dof, tuple[int, int]]]:
    """Position and first sign of every response and reference, in order of appearance."""
    responses: dict[Dof, tuple[int, int]] = {}
    references: dict[Dof, tuple[int, int]] = {}
    for number, record in frfs:
        response, reference = ends_of(path, number, record)
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
