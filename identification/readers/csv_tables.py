"""Rows of tables in .csv files."""

import csv
from pathlib import Path

from identification.words import InputError
from identification.words.csv_cells import name_of_cell
from identification.words.file_access import read_text


def read_csv_rows(path: Path, remedy: str) -> list[list[str]]:
    """Return the cells of each row; an empty line is a row without cells.

    Args:
        path: the file, in UTF-8 with or without a byte-order mark.
        remedy: what to give instead, for the message.

    Raises:
        InputError: the file cannot be read as text, or holds a cell that no table has.
    """
    rows: list[list[str]] = []
    try:
        for row in csv.reader(read_text(path, remedy).split("\n")):
            rows.append([name_of_cell(cell) for cell in row])
    except csv.Error as error:  # for example a quotation mark that is never closed
        raise InputError(f"{path}, row {len(rows) + 1}: {error}: {remedy}") from error
    while rows and not rows[-1]:
        rows.pop()
    return rows
