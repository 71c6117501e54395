"""FRFs and coherences of a universal file: function types 4 and 6 of dataset 58 and 58b."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identification.readers.frf_table import FrfTable
from identification.readers.uff_datasets import (
    Record,
    ends_of,
    read_records,
    refuse_malformed,
    unit_factors,
)
from identification.words import Dof, InputError, Quantity

_FRF, _COHERENCE = 4, 6
_SAME = 1e-5  # relative difference below which two records are one, written twice
_QUANTITIES: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}


def read_uff(path: Path, quantity: Quantity | None = None) -> FrfTable:
    """Read the FRFs and coherences of a universal file.

    Of several records with one response and reference the one with the best coherence is used;
    the table's remarks name them.

    Args:
        path: the file.
        quantity: what campaign.toml says; needed where the ordinate's type is 0 (unknown).

    Raises:
        InputError: with file and record: missing file, truncated or malformed record, NaN,
            unequal axes, a scalar direction, no FRF at all.
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
    shape = (len(freq_hz), len(responses), len(references))
    cells: dict[tuple[int, int], _Cell] = {}
    kinds = set()
    for number, record in functions:
        response, reference = ends_of(path, number, record)
        if response.positive not in responses or reference.positive not in references:
            continue  # a coherence without its FRF
        place = responses[response.positive][0], references[reference.positive][0]
        cell = cells.setdefault(place, _Cell(f"{response}, {reference}"))
        if record["func_type"] == _COHERENCE:
            cell.coherences.append(np.clip(np.real(record["data"]), 0.0, 1.0))
            continue
        kinds.add(_quantity(path, number, record, quantity))
        sign = responses[response.positive][1] * response.sign
        sign *= references[reference.positive][1] * reference.sign
        factor = sign * _to_si(factors[number], response, reference)
        cell.frfs.append((number, factor * np.asarray(record["data"], complex)))
    if len(kinds) > 1:
        raise InputError(f"{path} mixes {' and '.join(sorted(kinds))}: give one file for each")
    table, coherence = np.zeros(shape, complex), np.full(shape, np.nan)
    measured = np.zeros(shape[1:], bool)
    remarks = []
    for place, cell in cells.items():
        if not cell.frfs:
            continue
        best, remark = cell.chosen(path)
        table[:, *place], measured[place] = cell.frfs[best][1], True
        if len(cell.coherences) == len(cell.frfs):
            coherence[:, *place] = cell.coherences[best]
        remarks += remark
    return FrfTable(
        freq_hz=freq_hz,
        values=table,
        coherence=coherence,
        measured=measured,
        responses=tuple(Dof.of(d.point, d.axis, sign) for d, (_, sign) in responses.items()),
        references=tuple(Dof.of(d.point, d.axis, sign) for d, (_, sign) in references.items()),
        quantity=kinds.pop(),
        remarks=tuple(remarks),
    )


@dataclass
class _Cell:
    """Records of one response and reference, in the order of the file."""

    dofs: str
    frfs: list[tuple[int, np.ndarray]] = field(default_factory=list)
    coherences: list[np.ndarray] = field(default_factory=list)

    def chosen(self, path: Path) -> tuple[int, list[str]]:
        """Which record counts: of several the one with the best coherence, else the first."""
        if len(self.frfs) == 1:
            return 0, []
        known = len(self.coherences) == len(self.frfs)
        best = int(np.argmax([c.mean() for c in self.coherences])) if known else 0
        number, values = self.frfs[best]
        size = max(float(np.linalg.norm(values)), 1e-300)
        apart = max(float(np.linalg.norm(other - values)) for _, other in self.frfs) / size
        numbers = ", ".join(str(other) for other, _ in self.frfs)
        how = "are the same" if apart < _SAME else f"differ by up to {100 * apart:.2g} %"
        better = "its coherence is best" if known else "the first"
        why = "they count once" if apart < _SAME else better
        return best, [
            f"{path.name}: records {numbers} hold one response and reference ({self.dofs}) and "
            f"{how}: record {number} is used, {why}"
        ]


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
