"""Table of modes without shapes: columns frequency, damping, and optionally what moves most.

A CSV table such as the one in a report of a modal analysis. Columns may stand in any order:

    frequency     natural frequency [Hz]; required
    frequency_sd  its standard deviation [Hz]
    damping       damping ratio; ``damping/%`` for per cent
    damping_sd    its standard deviation; ``damping_sd/%`` for per cent
    body          body that moves most
    direction     its direction, tx .. rz or x, y, z; several as in ``tx+ty``: these together

Cells may be empty, but for the frequency. ``modes.csv`` of ``mbw identify`` is such a table. A line
that begins with # is a comment.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from identification.readers.csv_tables import read_csv_rows
from identification.words import DIRECTIONS, MAX_FREQUENCY_HZ, InputError, read_number

_TABLE_REMEDY = "give a table with the columns frequency, damping, body, direction"
_MIN_TABLE_FREQUENCY_HZ = 1e-6  # a lower one is a motion at rest
_PER_CENT = "/%"  # end of a column's name
_SCALED_COLUMNS = ("damping", "damping_sd")  # of which the name may end in /%
# Bare steel or aluminium has 0.01 to 0.1 %; joints, guides and cables of a machine add more. Thus
# per cent below 0.1 in all rows are hardly those of a machine, but are usual as ratios (10 %).
_MIN_MACHINE_DAMPING = 1e-3
_MAX_RINGING_DAMPING = 0.2  # a mode of 20 % is down to a quarter after one period: it hardly rings
_WORD_COLUMNS = ("body", "direction")
_AXES = ("x", "y", "z")  # short for tx, ty, tz
_MODE_COLUMNS = ("frequency", "frequency_sd", *_SCALED_COLUMNS, *_WORD_COLUMNS)


@dataclass(frozen=True)
class TabulatedMode:
    """One row of a table of modes.

    Args:
        line: number of its line in the file, from 1.
        freq_hz: natural frequency [Hz].
        damping: damping ratio, or None.
        freq_sd_hz: standard deviation of the frequency [Hz], or None.
        damping_sd: standard deviation of the damping ratio, or None.
        body: name of the body that moves most; empty if not stated.
        directions: directions in which it moves; all translations or all rotations.
    """

    line: int
    freq_hz: float
    damping: float | None = None
    freq_sd_hz: float | None = None
    damping_sd: float | None = None
    body: str = ""
    directions: tuple[str, ...] = ()

    @property
    def motion(self) -> str:
        """The motion that is largest, such as ``hexapod:tx+ty``; empty if not stated."""
        return f"{self.body}:{'+'.join(self.directions)}" if self.body else ""


@dataclass(frozen=True)
class ModeTable:
    """A table of modes by rising frequency.

    Args:
        source: path of the file.
        modes: rows; at least one.
        remarks: sentences for the user.
    """

    source: Path
    modes: tuple[TabulatedMode, ...]
    remarks: tuple[str, ...] = ()


def read_mode_table(path: Path) -> ModeTable:
    """Read a table of modes.

    Raises:
        InputError: the file is missing or no table, or a row is invalid; the message names the row.
    """
    rows = [
        (line, [cell.strip() for cell in row])
        for line, row in enumerate(read_csv_rows(path, _TABLE_REMEDY), start=1)
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
    ]
    if not rows:
        raise InputError(f"{path} is empty: {_TABLE_REMEDY}")
    first_line, header = rows[0]
    columns = _columns(f"{path}, row {first_line}", header)
    modes = [_mode(path, line, row, header, columns) for line, row in rows[1:]]
    if not modes:
        raise InputError(f"{path} has no mode: add one row for each below the columns' names")
    unused = [name for name in header if name and name not in columns]
    remarks = [f"{path.name}: columns that do not count: {', '.join(unused)}"] if unused else []
    remarks += _damping_remarks(path, columns, modes)
    return ModeTable(path, tuple(sorted(modes, key=lambda mode: mode.freq_hz)), tuple(remarks))


def _damping_remarks(
    path: Path, columns: dict[str, str], modes: Sequence[TabulatedMode]
) -> list[str]:
    """Return a remark if all damping is implausible for a machine, but plausible times 100 or 0.01.

    Args:
        path: the table, for the message.
        columns: quantity of each column, by the column's name.
        modes: rows of the table.
    """
    values = [mode.damping for mode in modes if mode.damping is not None]
    heading = next((name for name, quantity in columns.items() if quantity == "damping"), "")
    if not values:
        return []
    span = f"{100 * min(values):.2g} to {100 * max(values):.2g} %"
    is_per_cent, least = heading.endswith(_PER_CENT), _MIN_MACHINE_DAMPING
    if is_per_cent and least / 100 <= min(values) <= max(values) < least:
        return [
            f"{path.name}: by its heading {heading} the damping is {span}, below the "
            f"{100 * least:g} % of bare metal in every row: if the values are ratios, name the "
            "column damping"
        ]
    if not is_per_cent and min(values) > _MAX_RINGING_DAMPING:
        return [
            f"{path.name}: by its heading {heading} the damping is {span}, at which no mode rings: "
            "if the values are per cent, name the column damping/%"
        ]
    return []


def _columns(where: str, header: Sequence[str]) -> dict[str, str]:
    """Return the quantity of each column that counts, by the column's name."""
    columns: dict[str, str] = {}
    for name in header:
        quantity = name.lower().removesuffix("/hz")
        if quantity.endswith(_PER_CENT) and quantity.removesuffix(_PER_CENT) in _SCALED_COLUMNS:
            quantity = quantity.removesuffix(_PER_CENT)
        if quantity not in _MODE_COLUMNS:
            continue
        if quantity in columns.values():
            raise InputError(f"{where}: there are two columns {quantity}: keep one")
        columns[name] = quantity
    if "frequency" not in columns.values():
        raise InputError(
            f"{where} names no column frequency, but {', '.join(map(repr, header))}: "
            f"{_TABLE_REMEDY}, separated by commas"
        )
    return columns


def _mode(
    path: Path, line: int, row: Sequence[str], header: Sequence[str], columns: dict[str, str]
) -> TabulatedMode:
    where = f"{path}, row {line}"
    if len(row) != len(header):
        raise InputError(
            f"{where} has {len(row)} cells, but there are {len(header)} columns: correct the row"
        )
    cells = {columns[name]: cell for name, cell in zip(header, row, strict=True) if name in columns}
    factors = {
        quantity: 0.01 if name.endswith(_PER_CENT) else 1.0 for name, quantity in columns.items()
    }
    numbers = {
        quantity: _number(where, quantity, cell, factors[quantity])
        for quantity, cell in cells.items()
        if quantity not in _WORD_COLUMNS
    }
    frequency, damping = numbers["frequency"], numbers.get("damping")
    if frequency is None or not _MIN_TABLE_FREQUENCY_HZ <= frequency <= MAX_FREQUENCY_HZ:
        raise InputError(
            f"{where}: frequency {cells['frequency']!r} is no natural frequency: give Hz above 0 "
            f"and up to {MAX_FREQUENCY_HZ:g}"
        )
    if damping is not None and not 0 < damping < 1:
        raise InputError(
            f"{where}: damping {cells['damping']!r} is no damping ratio of a mode that oscillates: "
            "give a number between 0 and 1, or name the column damping/% for per cent"
        )
    for quantity in ("frequency_sd", "damping_sd"):
        value = numbers.get(quantity)
        if value is not None and not value > 0:
            raise InputError(
                f"{where}: {quantity} {cells[quantity]!r} is no standard deviation: give a number "
                "above 0, or leave the cell empty"
            )
    body, direction = cells.get("body", ""), cells.get("direction", "")
    return TabulatedMode(
        line,
        frequency,
        damping,
        numbers.get("frequency_sd"),
        numbers.get("damping_sd"),
        body,
        _directions(where, body, direction),
    )


def _number(where: str, quantity: str, cell: str, factor: float) -> float | None:
    """Return the number of a cell times a factor; None for an empty cell."""
    if not cell:
        return None
    value = read_number(cell)
    if not math.isfinite(value):
        raise InputError(
            f"{where}: {quantity} {cell!r} is no number: write one with a point, or leave the cell "
            "empty"
        )
    return factor * value


def _directions(where: str, body: str, text: str) -> tuple[str, ...]:
    """Return the directions of a text such as ``tx``, ``x`` or ``tx+ty``."""
    words = text.lower().replace("+", " ").split()
    directions = tuple(dict.fromkeys(f"t{word}" if word in _AXES else word for word in words))
    unknown = [word for word in directions if word not in DIRECTIONS]
    if unknown or len({word[0] for word in directions}) > 1:
        raise InputError(
            f"{where}: direction {text!r} is none of {', '.join(DIRECTIONS)}: write one of them, "
            "or several of one kind such as tx+ty"
        )
    if bool(body) != bool(directions):
        raise InputError(
            f"{where} states a body or a direction alone: state both, or leave both cells empty"
        )
    return directions
