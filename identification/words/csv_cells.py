"""Cells of CSV tables: a name that a spreadsheet would compute as a formula is marked as text.

Spreadsheets run a cell that begins with ``=``, ``+``, ``-`` or ``@``. Names come from files of
others, so that such a cell gets an apostrophe, the mark of text in spreadsheets. Numbers stay.
"""

import csv
from collections.abc import Iterable
from typing import TextIO

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
_TEXT_MARK = "'"


def write_csv(stream: TextIO, rows: Iterable[Iterable[object]], line_end: str = "\n") -> None:
    """Write rows as CSV, with names that look like formulas as text.

    Args:
        stream: open text file.
        rows: cells; texts and numbers.
        line_end: end of a line.
    """
    writer = csv.writer(stream, lineterminator=line_end)
    writer.writerows([cell_text(cell) for cell in row] for row in rows)


def cell_text(cell: object) -> object:
    """Return a cell, marked as text if a spreadsheet would compute it."""
    if not isinstance(cell, str) or not cell.startswith(_FORMULA_STARTS) or _is_number(cell):
        return cell
    return _TEXT_MARK + cell


def name_of_cell(cell: str) -> str:
    """Return the name in a cell that ``cell_text`` has marked; other cells as they are."""
    is_marked = cell.startswith(_TEXT_MARK) and cell[1:].startswith(_FORMULA_STARTS)
    return cell[1:] if is_marked else cell


def _is_number(text: str) -> bool:
    """Return whether a text is a number."""
    try:
        complex(text)
    except ValueError:
        return False
    return True
