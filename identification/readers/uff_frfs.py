"""FRFs and coherences of universal files: function types 4 and 6 of datasets 58 and 58b."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identification.readers.frf_table import FrfTable, real_coherence
from identification.readers.uff_datasets import (
    FUNCTION_DATASET,
    UNITS_DATASET,
    Record,
    read_records,
    refuse_malformed,
    unit_factors,
)
from identification.readers.uff_directions import StatedDirections
from identification.readers.uff_units import UnitConverter
from identification.readers.units import frequency_factor
from identification.words import Dof, InputError, Quantity, percent_text

FRF_TYPE, _COHERENCE_TYPE = 4, 6  # function types
_MAX_DUPLICATE_DIFFERENCE = 1e-5  # relative: below it two records are one, written twice
_MAX_AXIS_DIFFERENCE = 1e-3  # of the spacing of lines: frequency axes differ by rounding alone
_TINY_NORM = 1e-300  # avoids a division by zero
QUANTITY_OF_ORDINATE: dict[int, Quantity] = {8: "receptance", 11: "mobility", 12: "accelerance"}


def read_uff(
    path: Path,
    quantity: Quantity | None = None,
    unit: str | None = None,
    frequency_unit: str | None = None,
    *,
    channels: str | list[str] | None = None,
    references: list[str] | None = None,
) -> FrfTable:
    """Read the FRFs and coherences of a universal file.

    If several records have one response and reference, the one with the best coherence is used.
    The remarks of the table name such records.

    Args:
        quantity: quantity that campaign.toml states, which overrides the file; needed if the
            ordinate type is 0 (unknown).
        unit: unit that campaign.toml states, such as ``g/N``, which overrides the file.
        frequency_unit: unit of the frequencies that campaign.toml states, which overrides the file.
        channels: responses that campaign.toml states, for scalar records.
        references: references that campaign.toml states, for scalar records.

    Raises:
        InputError: the file is missing or holds no FRF; or a record is truncated or malformed, has
            NaN, a scalar direction or another frequency axis. The message names the record.
    """
    records, skipped = read_records(
        path, (FUNCTION_DATASET, UNITS_DATASET), (FRF_TYPE, _COHERENCE_TYPE)
    )
    factors = unit_factors(path, records)
    has_units = any(record["type"] == UNITS_DATASET for _, record in records)
    converter = UnitConverter(path, unit, has_units)
    functions = [(number, record) for number, record in records if record["type"] != UNITS_DATASET]
    frfs = [item for item in functions if item[1]["func_type"] == FRF_TYPE]
    if not frfs:
        raise InputError(f"{path} holds no FRF (dataset 58, function type 4): export FRFs")
    label = str(functions[0][1].get("abscissa_axis_units_lab", ""))
    hertz, axis_remarks = frequency_factor(path, frequency_unit, label)
    freq_hz = hertz * _common_axis(path, functions)
    directions = StatedDirections.parse(path, channels, references)
    responses, inputs = _labels(directions, frfs)
    directions.refuse_unused()
    shape = (len(freq_hz), len(responses), len(inputs))
    cells: dict[tuple[int, int], _Cell] = {}
    kinds = set()
    for number, record in functions:
        response, reference = directions.response_and_reference(number, record)
        if response.positive not in responses or reference.positive not in inputs:
            continue  # a coherence without its FRF
        place = responses[response.positive][0], inputs[reference.positive][0]
        cell = cells.setdefault(place, _Cell(f"{response}, {reference}"))
        if record["func_type"] == _COHERENCE_TYPE:
            cell.coherences.append(real_coherence(f"{path}, record {number}", record["data"]))
            continue
        kind = _quantity(path, number, record, quantity, converter.remarks)
        kinds.add(kind)
        sign = responses[response.positive][1] * response.sign
        sign *= inputs[reference.positive][1] * reference.sign
        factor = sign * converter.factor(record, kind, factors[number], response, reference)
        cell.frfs.append((number, factor * np.asarray(record["data"], complex)))
    if len(kinds) > 1:
        raise InputError(f"{path} mixes {' and '.join(sorted(kinds))}: give one file for each")
    table, coherence = np.zeros(shape, complex), np.full(shape, np.nan)
    measured = np.zeros(shape[1:], bool)
    remarks = []
    for place, cell in cells.items():
        if not cell.frfs:
            continue
        best, cell_remarks = cell.choose_record(path)
        table[:, *place], measured[place] = cell.frfs[best][1], True
        if len(cell.coherences) == len(cell.frfs):
            coherence[:, *place] = cell.coherences[best]
        remarks += cell_remarks
    return FrfTable(
        freq_hz=freq_hz,
        values=table,
        coherence=coherence,
        measured=measured,
        responses=tuple(Dof.of(d.point, d.axis, sign) for d, (_, sign) in responses.items()),
        references=tuple(Dof.of(d.point, d.axis, sign) for d, (_, sign) in inputs.items()),
        quantity=kinds.pop(),
        remarks=(*skipped, *axis_remarks, *converter.remarks, *remarks),
    )


@dataclass
class _Cell:
    """Records of one response and reference, in the order of the file."""

    dofs: str
    frfs: list[tuple[int, np.ndarray]] = field(default_factory=list)
    coherences: list[np.ndarray] = field(default_factory=list)

    def choose_record(self, path: Path) -> tuple[int, list[str]]:
        """Return the index of the record to use, and remarks on duplicates.

        It is the record with the highest mean coherence, or the first if coherences are missing.
        """
        if len(self.frfs) == 1:
            return 0, []
        known = len(self.coherences) == len(self.frfs)
        best = int(np.argmax([c.mean() for c in self.coherences])) if known else 0
        number, values = self.frfs[best]
        size = max(float(np.linalg.norm(values)), _TINY_NORM)
        difference = max(float(np.linalg.norm(frf - values)) for _, frf in self.frfs) / size
        numbers = ", ".join(str(record) for record, _ in self.frfs)
        is_duplicate = difference < _MAX_DUPLICATE_DIFFERENCE
        how = "are identical" if is_duplicate else f"differ by up to {percent_text(difference)}"
        better = "its coherence is best" if known else "it is the first"
        why = "they count once" if is_duplicate else better
        return best, [
            f"{path.name}: records {numbers} hold one response and reference ({self.dofs}) and "
            f"{how}: record {number} is used, {why}"
        ]


def _common_axis(path: Path, functions: list[tuple[int, Record]]) -> np.ndarray:
    """Return the frequency axis [Hz] that all records share; (n_freq,)."""
    for number, record in functions:
        refuse_malformed(f"{path}, record {number}", record)
    first_number, first = functions[0]
    axis = np.asarray(first["x"], float)
    if not (np.diff(axis) > 0).all():
        raise InputError(
            f"{path}, record {first_number}: its frequencies do not increase; export it again"
        )
    spacing = np.diff(axis).min() if axis.size > 1 else 1.0
    for number, record in functions:
        freq_hz = np.asarray(record["x"], float)
        tolerance = _MAX_AXIS_DIFFERENCE * spacing
        if freq_hz.shape != axis.shape or np.abs(freq_hz - axis).max() > tolerance:
            raise InputError(
                f"{path}: records {first_number} and {number} have unequal frequency axes "
                f"({_span(axis)}; {_span(freq_hz)}): export all records with one axis"
            )
    return axis


def _span(axis: np.ndarray) -> str:
    """Return the number of lines and the frequency range of an axis as text."""
    return f"{axis.size} lines {axis[0]:g}..{axis[-1]:g} Hz"


def _labels(
    directions: StatedDirections, frfs: list[tuple[int, Record]]
) -> tuple[dict[Dof, tuple[int, int]], dict[Dof, tuple[int, int]]]:
    """Return index and first sign of every response and reference, in order of appearance."""
    responses: dict[Dof, tuple[int, int]] = {}
    references: dict[Dof, tuple[int, int]] = {}
    for number, record in frfs:
        response, reference = directions.response_and_reference(number, record)
        responses.setdefault(response.positive, (len(responses), response.sign))
        references.setdefault(reference.positive, (len(references), reference.sign))
    return responses, references


def _quantity(
    path: Path,
    number: int,
    record: Record,
    expected: Quantity | None,
    remarks: dict[str, None],
) -> Quantity:
    """Return the quantity of an FRF; the stated one overrides the file, with a remark."""
    kind = int(record["ordinate_spec_data_type"])
    if int(record["orddenom_spec_data_type"]) in QUANTITY_OF_ORDINATE:
        raise InputError(
            f"{path}, record {number} is a transmissibility, motion per motion: export FRFs per "
            "force"
        )
    quantity = QUANTITY_OF_ORDINATE.get(kind) or (expected if kind in (0, 1) else None)
    if quantity and expected and quantity != expected:
        remarks.setdefault(
            f'{path.name}: quantity = "{expected}" of campaign.toml overrides {quantity}, which '
            "the file names"
        )
        return expected
    if quantity is None:
        raise InputError(
            f"{path}, record {number}: ordinate type {kind} is none of displacement (8), "
            'velocity (11), acceleration (12): set quantity = "accelerance" in campaign.toml'
        )
    return quantity
