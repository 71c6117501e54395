"""Markdown of tables and numbers."""

import math
from collections.abc import Iterable, Sequence


def table(header: Sequence[str], rows: Iterable[Sequence[object]], text: int = 1) -> str:
    """Return a Markdown table; numbers stand to the right.

    Args:
        header: names of the columns.
        rows: cells.
        text: number of columns, from the left, that hold text.
    """
    rule = ["---" if column < text else "---:" for column in range(len(header))]
    lines = [header, rule, *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, without an exponent where it is readable.

    Args:
        value: the number; None gives an empty cell.
        digits: number of significant digits.
    """
    if value is None:
        return ""
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude < -4:
        return f"{value:.{digits - 1}e}"
    rounded = round(value, digits - 1 - magnitude)
    return f"{rounded:.{max(0, digits - 1 - math.floor(math.log10(abs(rounded))))}f}"


def fixed(value: float | None, decimals: int) -> str:
    """Return a number with so many decimals; None gives an empty cell."""
    return "" if value is None else f"{value:.{decimals}f}"


def percent(share: float, decimals: int = 1) -> str:
    """Return a share between 0 and 1 in percent."""
    return f"{100 * share:.{decimals}f} %"


def code_span(name: str) -> str:
    """Return a name as a code span."""
    return f"`{name}`"
