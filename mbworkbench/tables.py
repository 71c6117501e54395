"""Tables and figures that every result shows: HTML for a notebook, rows for pandas."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from html import escape
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from identification.words import UsageError

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Table:
    """A table of plain values.

    Attributes:
        title: caption.
        header: names of the columns.
        rows: cells; each row as long as the header.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[object]]

    def to_html(self) -> str:
        """Return the table for a notebook."""
        head = "".join(f"<th>{escape(name)}</th>" for name in self.header)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(cell_text(cell))}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        caption = f"<caption>{escape(self.title)}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class Shown(ABC):
    """A result with a table: shown in a notebook, given to pandas, drawn by ``plot``."""

    @abstractmethod
    def table(self) -> Table:
        """Return the rows of the result."""

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the table as a DataFrame.

        Raises:
            UsageError: pandas is not installed.
        """
        if find_spec("pandas") is None:
            raise UsageError("pandas is not installed: pip install pandas")
        pandas = import_module("pandas")  # optional, and slow to load
        table = self.table()
        return pandas.DataFrame(list(table.rows), columns=list(table.header))

    def plot(self) -> Any:
        """Return a plotly figure of the result.

        Raises:
            TypeError: there is no figure of this type.
        """
        return plot(self)

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return self.table().to_html()


@singledispatch
def plot(result: object) -> Any:
    """Return a plotly figure of a result.

    FRFs are drawn with magnitude and phase; a campaign with its drive points and their coherence;
    modes with frequency and damping; a tuned model beside the measurement at the drive points; a
    diagnosis with its gap, places and causes; a comparison with the shifts of its modes; an error
    budget with its cumulative spectra.

    Args:
        result: ``Frf``, ``FrfEstimate``, or what ``read_campaign``, ``identify``, ``modes``,
            ``tune``, ``diagnose``, ``compare`` or ``error_budget`` returned.

    Raises:
        TypeError: there is no figure of this type.
    """
    raise TypeError(
        f"there is no figure of {type(result).__name__}: give an FRF, a campaign, modes, a tuned "
        "model or a diagnosis"
    )


def cell_text(value: object) -> str:
    """Return a value as text: floats with four digits, None as a dash."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
