"""Tables of numbers in text files (.csv, .txt, .dat): separators, headers, complex cells.

The separator is a tab, ``;``, ``,`` or blanks; with another one than the comma, the comma may be
the decimal sign. A complex number is written ``0.1-0.2j``, ``0.1-0.2i``, ``(0.1-0.2j)`` or
``0.1+-0.2j``. Header lines may precede the numbers; a line that begins with ``#``, ``%``, ``!`` or
``//`` is a comment.
"""

import codecs
import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.words import MAX_INPUT_MAGNITUDE, Complex, InputError, Real
from identification.words.file_access import check_file, read_bytes

_TEXT_FILE_REMEDY = "name the file of the test"
_CELL_SEPARATORS = ("\t", ";", ",", None)  # None: blanks
_COMMENT_MARKS = ("#", "%", "!", "//")
# Python needs about ten times as much memory for the lines and cells of a text.
_MAX_TEXT_BYTES = 2**28
_AXIS_HEADINGS = {"frequency", "freq", "hz", "time"}
_MAX_QUOTED_CELL = 30  # of a wrong cell in a message
_ASCII_DIGIT = re.compile("[0-9]")
_INNER_BLANKS = re.compile(r"\s+(?=[+\-*ijIJ)])|(?<=[+\-*(])\s+")  # of 0.1 - 0.2 i
# Signs of other programs: i for j, exponents of Fortran, factor of i.
_PYTHON_SIGNS = str.maketrans({"i": "j", "I": "j", "J": "j", "d": "e", "D": "e", "*": None})


@dataclass(frozen=True, eq=False)
class TextTable:
    """Columns over frequency or time, as a text file holds them.

    Args:
        path: the file, for messages.
        axis_name: heading of the first column; empty without one.
        axis: frequencies or times, strictly rising; (n_row,).
        names: headings of the other columns, empty without one; n_column.
        values: numbers of the other columns; (n_row, n_column).
    """

    path: Path
    axis_name: str
    axis: Real
    names: tuple[str, ...]
    values: Complex


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file of measured numbers.

    Text that is no UTF-8, such as headings with m/s² from Windows, counts as Latin-1; UTF-16 has a
    byte-order mark.

    Raises:
        InputError: the file is missing or larger than 256 MiB.
    """
    check_file(path, _TEXT_FILE_REMEDY)
    size = path.stat().st_size
    if size > _MAX_TEXT_BYTES:
        raise InputError(
            f"{path} has {size / 2**20:.0f} MiB of text, more than {_MAX_TEXT_BYTES >> 20}: save "
            "its numbers as .npz or .mat"
        )
    content = read_bytes(path, _TEXT_FILE_REMEDY)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def read_text_table(path: Path) -> TextTable:
    """Read a table whose first column is frequency or time.

    A first column without a heading that precedes a frequency is a row number and left out.

    Raises:
        InputError: the file is no such table; the message names the line.
    """
    lines = read_lines(path)
    start, separator = _first_row(path, lines)
    width = len(split_cells(lines[start], separator))
    headers = [split_cells(_uncomment(line), separator) for line in lines[:start]]
    fitting = [cells for cells in headers if len(cells) == width]
    names = [" ".join(filter(None, column)) for column in zip(*fitting, strict=True)]
    names = names or [""] * width
    numbers = [
        (number, split_cells(line, separator))
        for number, line in enumerate(lines[start:], start=start + 1)
        if line.strip() and not line.lstrip().startswith(_COMMENT_MARKS)
    ]
    table = parse_rows(path, numbers, width)
    first = next((k for k, name in enumerate(names) if name), 0)
    first = first if name_words(names[first]) & _AXIS_HEADINGS else 0
    if width - first < 2:
        raise InputError(f"{path} has no column beside {names[first]!r}: export the FRFs too")
    axis = real_axis(path, [number for number, _ in numbers], table[:, first])
    return TextTable(path, names[first], axis, tuple(names[first + 1 :]), table[:, first + 1 :])


def parse_rows(path: Path, rows: Sequence[tuple[int, Sequence[str]]], width: int) -> Complex:
    """Return the numbers of all rows; (n_row, width).

    Args:
        rows: number of its line in the file, and cells, of each row.
        width: number of cells that each row must have.

    Raises:
        InputError: a row has another number of cells, or a cell is no finite number.
    """
    values = np.empty((len(rows), width), complex)
    for place, (line, cells) in enumerate(rows):
        if len(cells) != width:
            raise InputError(
                f"{path}, line {line} has {len(cells)} cells, but the first row has {width}: "
                "complete the row, or begin a line that is no data with #"
            )
        if (real := _plain_numbers(cells)) is not None:
            values[place] = real
            continue
        for column, cell in enumerate(cells):
            number = parse_number(cell)
            if number is None or not abs(number) <= MAX_INPUT_MAGNITUDE:  # also true for NaN
                raise InputError(
                    f"{path}, line {line}, column {column + 1}: "
                    f"{cell[:_MAX_QUOTED_CELL]!r} is no number up to "
                    f"{MAX_INPUT_MAGNITUDE:g}: write 0.1 or 0.1-0.2j, leave the row out, or begin "
                    "a line that is no data with #"
                )
            values[place, column] = number
    return values


def _plain_numbers(cells: Sequence[str]) -> list[float] | None:
    """Return the numbers of a row of real numbers within bounds, fast; None for another row."""
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        return None
    is_plain = "_" not in "".join(cells)  # which Python allows within numbers
    bound = MAX_INPUT_MAGNITUDE
    return numbers if is_plain and all(-bound <= number <= bound for number in numbers) else None


def parse_number(cell: str) -> complex | None:
    """Return the real or complex number of a cell; None if it is another text."""
    if "_" in cell or (not _ASCII_DIGIT.search(cell) and cell.lower() != "nan"):
        return None
    text = _INNER_BLANKS.sub("", cell).removeprefix("(").removesuffix(")").translate(_PYTHON_SIGNS)
    try:
        return complex(text.replace("+-", "-").replace(",", "."))
    except ValueError:
        return None


def real_axis(path: Path, lines: Sequence[int], axis: Complex) -> Real:
    """Return the frequencies or times of a table.

    Args:
        lines: number of the line in the file of each row; n_row.
        axis: numbers of the first column; (n_row,).

    Raises:
        InputError: a number has an imaginary part, or does not exceed the one before.
    """
    odd = np.flatnonzero(axis.imag)
    if odd.size:
        raise InputError(
            f"{path}, line {lines[odd[0]]}: the first column, {axis[odd[0]]:g}, is complex: put "
            "frequency or time first"
        )
    back = np.flatnonzero(np.diff(axis.real) <= 0)
    if back.size:
        before, after = axis.real[back[0] : back[0] + 2]
        raise InputError(
            f"{path}, line {lines[back[0] + 1]}: the first column does not increase, {after:g} "
            f"after {before:g}: sort the rows, and drop repeated ones"
        )
    return np.array(axis.real)


def split_cells(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line without quotation marks; one empty cell at its end is none."""
    parts = line.split(separator)
    if separator is not None and '"' in line:
        with suppress(csv.Error):  # a quotation mark without its end: the cell is no number
            parts = next(csv.reader([line], delimiter=separator))
    cells = [cell.strip() for cell in parts]
    if '"' in line or "'" in line:
        cells = [cell.strip("\"'").strip() for cell in cells]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def name_words(name: str) -> set[str]:
    """Return the words of letters in a heading, in small letters."""
    return set("".join(sign if sign.isalpha() else " " for sign in name.lower()).split())


def _first_row(path: Path, lines: Sequence[str]) -> tuple[int, str | None]:
    """Return the place of the first row of numbers, and the separator."""
    for place, line in enumerate(lines):
        if not line.strip() or line.lstrip().startswith(_COMMENT_MARKS):
            continue
        splits = [(split_cells(line, separator), separator) for separator in _CELL_SEPARATORS]
        splits = [(cells, separator) for cells, separator in splits if len(cells) > 1]
        for cells, separator in splits:
            if all(parse_number(cell) is not None for cell in cells):
                return place, separator
        for cells, _ in splits:
            if parse_number(cells[0]) is not None:  # a row whose other cells are wrong
                parse_rows(path, [(place + 1, cells)], len(cells))
    raise InputError(
        f"{path} has no row of numbers: give frequency and FRFs such as 0.1-0.2j, separated by "
        "commas, semicolons, tabs or blanks"
    )


def _uncomment(line: str) -> str:
    """Return a header line without the mark of a comment."""
    return line.lstrip().lstrip("".join(_COMMENT_MARKS)) if line.strip() else ""
