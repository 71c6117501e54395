"""Table of tuned parameters."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

from identification.words import UsageError
from mbworkbench.tables import Shown, Table, cell_text
from tuning.files.schema import ParameterRow

MAX_LISTED = 8  # rows of the summary


@dataclass(frozen=True, eq=False, repr=False)
class ParameterTable(Shown, Sequence[ParameterRow]):
    """Parameters with nominal value, tuned value, 95 % interval and pull.

    ``table["tilt_tz.stiffness"]`` is the row of one parameter, ``table[0]`` the first row.

    Attributes:
        rows: one row for each parameter.
    """

    rows: tuple[ParameterRow, ...]

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.rows)

    def __iter__(self) -> Iterator[ParameterRow]:
        """Iterate over the rows."""
        return iter(self.rows)

    @overload
    def __getitem__(self, key: int | str) -> ParameterRow: ...

    @overload
    def __getitem__(self, key: slice) -> "ParameterTable": ...

    def __getitem__(self, key: int | str | slice) -> "ParameterRow | ParameterTable":
        """Return one row by number or name, or several by a slice.

        Raises:
            UsageError: there is no parameter of this name.
        """
        if isinstance(key, slice):
            return ParameterTable(self.rows[key])
        if isinstance(key, int):
            return self.rows[key]
        for row in self.rows:
            if row.name == key:
                return row
        raise UsageError(f"{key!r} is no parameter: the table lists {len(self.rows)} by name")

    def __repr__(self) -> str:
        """Return the first rows, and how many there are."""
        lines = [
            f"  {row.name}: {cell_text(row.drawn)} -> {cell_text(row.tuned)} {row.unit}"
            for row in self.rows[:MAX_LISTED]
        ]
        return "\n".join([f"{len(self.rows)} parameters, nominal -> tuned", *lines])

    def table(self) -> Table:
        """Return a table of all rows."""
        header = ("parameter", "unit", "nominal", "tuned", "low", "high", "pull")
        rows = [
            (row.name, row.unit, row.drawn, row.tuned, row.low, row.high, row.pull)
            for row in self.rows
        ]
        return Table(f"{len(self.rows)} parameters", header, rows)
