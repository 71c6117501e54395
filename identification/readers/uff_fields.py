"""Numbers and fields of the lines of universal files, which have fixed columns as in Fortran."""

import re
from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np

from identification.words import Real

# Fortran leaves the letter out before an exponent of three digits: 1.25-103.
_BARE_EXPONENT = re.compile(r"(?<=[\d.])(?=[-+]\d{3}\s*$)")


class FieldError(ValueError):
    """Fault of a dataset that a user can name to the exporter; the text is part of a sentence."""


def split_fields(line: str, widths: Sequence[int]) -> list[str]:
    """Return the fields of a line, without blanks around them; fields beyond its end are empty."""
    return [line[start:end].strip() for start, end in pairwise(accumulate(widths, initial=0))]


def parse_integer(field: str) -> int:
    """Return an integer; 0 for an empty field, as Fortran reads it."""
    return int(field) if field else 0


def parse_number(field: str) -> float:
    """Return a number, whose exponent may begin with D.

    Raises:
        ValueError: the field is empty or no number.
    """
    try:
        return float(field)
    except ValueError:
        letter = field.upper().replace("D", "E")
        return float(_BARE_EXPONENT.sub("E", letter))


def parse_numbers(lines: Sequence[str]) -> Real:
    """Return the numbers of lines that blanks separate."""
    return np.array([parse_number(field) for line in lines for field in line.split()], np.float64)


def parse_columns(lines: Sequence[str], widths: Sequence[int]) -> Real:
    """Return the numbers of lines with fixed columns, row by row.

    Args:
        lines: without their ends; the last one may be shorter.
        widths: of the columns of each line [characters].

    Raises:
        ValueError: a field is no number, or empty before the last one.
    """
    places = list(pairwise(accumulate(widths, initial=0)))
    fields = [line[start:end] for line in lines for start, end in places]
    while fields and not fields[-1].strip():
        fields.pop()
    return np.array([parse_number(field) for field in fields], np.float64)
