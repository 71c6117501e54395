"""Rows of tables in .csv files, and numbers below a header."""

import csv
from pathlib import Path

import numpy as np

from identification.words import InputError, Real, read_number
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


def read_number_table(path: Path, remedy: str) -> tuple[list[str], Real]:
    """Return the header of a table, and the numbers of the rows below it; (n, n_column).

    Args:
        path, remedy: as for ``read_csv_rows``.

    Raises:
        InputError: the file cannot be read, a row is of another width, or a cell is no finite
            number.
    """
    rows = [row for row in read_csv_rows(path, remedy) if any(map(str.strip, row))]
    if len(rows) < 2:
        raise InputError(f"{path} holds no numbers below a header: {remedy}")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(rows[0]):
            raise InputError(
                f"{path}, row {number} has {len(row)} columns, the header {len(rows[0])}"
            )
        if not np.isfinite(list(map(read_number, row))).all():
            raise InputError(
                f"{path}, row {number}: {','.join(row)!r} is no row of finite numbers: correct it"
            )
    return [cell.strip() for cell in rows[0]], np.array(rows[1:], float)
