"""LabVIEW measurement files (.lvm): text with a header, then sections of columns.

The header of the file names the separator, the decimal sign and the columns of x: none, one, or one
for each channel. A section has a header of its own with an entry for each channel (X0, Delta_X,
X_Dimension, Y_Unit_Label), a row of headings that ends in Comment, and the numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.readers.text_tables import (
    TextTable,
    parse_number,
    parse_rows,
    read_lines,
    real_axis,
    split_cells,
)
from identification.words import Complex, InputError, Real

_LABVIEW_HEADER_END = "***End_of_Header***"
_SPECIAL_START, _SPECIAL_END = "***Start_Special***", "***End_Special***"
_NAMED_SEPARATORS = {"Tab": "\t", "Comma": ","}
_MAX_COUNT_DIGITS = 7  # of the number of channels: more is no count
_MAX_SAMPLING_DIFFERENCE = 1e-6  # relative: channels of one section have one sampling

_Rows = list[tuple[int, list[str]]]  # number of the line in the file, and cells


@dataclass(frozen=True)
class _Form:
    """Layout that the header of a file gives to all its sections."""

    path: Path
    separator: str
    x_columns: str


def read_labview_text(path: Path) -> tuple[TextTable, ...]:
    """Read the sections of a LabVIEW measurement file.

    Raises:
        InputError: the file is no such file; the message names the line.
    """
    lines = read_lines(path)
    ends = [place for place, line in enumerate(lines) if line.strip(" \t,;") == _LABVIEW_HEADER_END]
    if not ends or not lines[0].startswith("LabVIEW Measurement"):
        raise InputError(
            f"{path} is no LabVIEW measurement file, which begins with LabVIEW Measurement and has "
            f"{_LABVIEW_HEADER_END}: export it again, or save it as .csv"
        )
    form = _form(path, lines[: ends[0]])
    rows = _rows(lines, ends[0] + 1, form.separator)
    starts = [k for k, (_, cells) in enumerate(rows) if cells[0] == "Channels"]
    if not starts:
        raise InputError(
            f"{path} has no line Channels behind its header: save it with segment headers"
        )
    stops = [*starts[1:], len(rows)]
    return tuple(_section(form, rows[a:b]) for a, b in zip(starts, stops, strict=True))


def _form(path: Path, header: Sequence[str]) -> _Form:
    """Return what the header of the file says."""
    separator = "\t" if any(line.startswith("Separator\t") for line in header) else ","
    keys = {cells[0]: cells[1] for line in header if len(cells := line.split(separator)) > 1}
    named = _NAMED_SEPARATORS.get(keys.get("Separator", "Tab").strip())
    x_columns = keys.get("X_Columns", "One").strip()
    if named is None or x_columns not in {"No", "One", "Multi"}:
        raise InputError(
            f"{path}: its header says Separator {keys.get('Separator')} and X_Columns {x_columns}, "
            "expected Tab or Comma and No, One or Multi: export it again"
        )
    return _Form(path, named, x_columns)


def _rows(lines: Sequence[str], start: int, separator: str) -> _Rows:
    """Return the rows of all sections, without empty lines and blocks of other programs."""
    rows: _Rows = []
    is_special = False
    for place in range(start, len(lines)):
        text = lines[place].strip(" \t,;")
        is_special = (is_special or text == _SPECIAL_START) and text != _SPECIAL_END
        if text and not is_special and text != _SPECIAL_END:
            rows.append((place + 1, split_cells(lines[place].rstrip(), separator)))
    return rows


def _section(form: _Form, rows: _Rows) -> TextTable:
    """Return the table of one section."""
    path = form.path
    end = next((k for k, (_, cells) in enumerate(rows) if cells[0] == _LABVIEW_HEADER_END), None)
    if end is None or len(rows) < end + 3:
        raise InputError(
            f"{path}, line {rows[0][0]}: the section has no {_LABVIEW_HEADER_END} with headings "
            "and numbers below it: export it again"
        )
    count = "".join(rows[0][1][1:2])
    per_channel = 2 if form.x_columns == "Multi" else 1
    n_channel = int(count) if count.isdecimal() and len(count) < _MAX_COUNT_DIGITS else 0
    width = per_channel * n_channel + (form.x_columns != "Multi")
    headings = rows[end + 1][1]
    if n_channel == 0 or len([name for name in headings if name != "Comment"]) != width:
        raise InputError(
            f"{path}, line {rows[end + 1][0]} has {len(headings)} headings, but {n_channel} "
            f"channels with X_Columns {form.x_columns} need {width} and Comment: export it again"
        )
    header = {cells[0]: _of_channels(cells[1:], n_channel) for _, cells in rows[:end]}
    numbers = [(line, cells[:width]) for line, cells in rows[end + 2 :]]
    if form.x_columns == "No":  # the cell of x is empty
        numbers = [(line, ["0", *cells[1:]]) for line, cells in numbers]
    table = parse_rows(path, numbers, width)
    lines = [line for line, _ in numbers]
    axis = _axis(form, header, rows[0][0], lines, table, n_channel)
    kinds = {kind.strip() for kind in header.get("X_Dimension", []) if kind.strip()}
    if len(kinds) > 1:
        raise InputError(
            f"{path}, line {rows[0][0]}: the section mixes {' and '.join(sorted(kinds))}: export "
            "them to files of their own"
        )
    units = [*header.get("Y_Unit_Label", []), *[""] * n_channel][:n_channel]
    names = [headings[_column(form, k)] for k in range(n_channel)]
    values = table[:, [_column(form, k) for k in range(n_channel)]]
    pairs = zip(names, units, strict=True)  # units tell the force where no heading does
    named = tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)
    return TextTable(path, next(iter(kinds), "Time"), axis, named, values)


def _column(form: _Form, channel: int) -> int:
    """Return the column of the values of a channel, from 0."""
    return 2 * channel + 1 if form.x_columns == "Multi" else channel + 1


def _of_channels(cells: list[str], n_channel: int) -> list[str]:
    """Return the cell of each channel, of which some stand above the second of two columns."""
    return cells[::2] if len(cells) > n_channel else cells


def _axis(  # all parts of one section
    form: _Form,
    header: dict[str, list[str]],
    first_line: int,
    lines: list[int],
    table: Complex,
    n_channel: int,
) -> Real:
    """Return x of a section from its columns, or from X0 and Delta_X; equal for all channels."""
    where = f"{form.path}, line {first_line}"
    if form.x_columns == "Multi":
        columns = table[:, : 2 * n_channel : 2]
        if (columns != columns[:, :1]).any():
            raise InputError(
                f"{where}: the channels of the section have x of their own: export channels that "
                "were sampled together"
            )
    if form.x_columns != "No":
        return real_axis(form.path, lines, table[:, 0])
    start, step = (
        _common_number(where, name, header.get(name, []), n_channel) for name in ("X0", "Delta_X")
    )
    if step <= 0:
        raise InputError(f"{where}: Delta_X is {step:g}, expected more than 0: export it again")
    return np.asarray(start + step * np.arange(len(lines)), np.float64)


def _common_number(where: str, name: str, cells: list[str], n_channel: int) -> float:
    """Return the number that the header of a section gives for each of its channels."""
    numbers = [parse_number(cell) for cell in cells[:n_channel]]
    values = [number.real for number in numbers if number is not None]
    if len(values) < n_channel or np.ptp(values) > _MAX_SAMPLING_DIFFERENCE * max(map(abs, values)):
        raise InputError(
            f"{where}: {name} is missing or differs between channels of the section: export "
            "channels that were sampled together, with their headers"
        )
    return values[0]
