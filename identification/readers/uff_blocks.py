"""Location of the datasets of a universal file: where each begins and ends, and of what kind it is.

A line of -1 begins and ends each dataset. The data of a binary dataset 58b may hold such a line, so
its end follows from the number of its values. Records are the datasets, counted from 1.

Numbers and fields of the lines of universal files, which have fixed columns as in Fortran.

Binary data of datasets 58b: where they end, and their points.

The bytes of one point follow from the ordinate data form and the spacing of the abscissa. Writers
deviate: some write values of single precision in double precision, some write the abscissa of
double-precision values in single precision. What was written shows in the number of bytes.
"""

import codecs
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np

from identification.words import InputError, Real
from identification.words.file_access import read_bytes

_DATASET_MARK = re.compile(rb"(?m)^[ ]{4}-1[ ]*(\r?\n|\r?\Z)")


@dataclass(frozen=True)
class Block:
    """One dataset of a universal file.

    Args:
        number: of the record, from 1.
        kind: number of the dataset; 0 if its first line holds none.
        head: its first line.
        text: lines after the first; of binary data the header only.
        data: binary data; empty in an ASCII dataset.
    """

    number: int
    kind: int
    head: bytes
    text: bytes
    data: bytes | None = None

    def lines(self) -> list[str]:
        """Return the lines after the first as text."""
        return self.text.decode("utf-8", "replace").replace("\r", "").split("\n")


def locate_blocks(path: Path) -> list[Block]:
    """Return the datasets of a file, each checked for its end mark.

    Raises:
        InputError: the file is missing, truncated or no universal file.
    """
    content = read_bytes(path, "name the UFF file of the test").removeprefix(codecs.BOM_UTF8)
    blocks = list(_blocks(path, content))
    if not blocks:
        raise InputError(f"{path} holds no dataset between lines of -1: name a universal file")
    return blocks


def _blocks(path: Path, content: bytes) -> Iterator[Block]:
    """Yield the datasets in their order."""
    position, number = 0, 0
    while mark := _DATASET_MARK.search(content, position):
        number += 1
        name, start = f"{path}, record {number}", mark.end()
        data = None
        if content[start : start + 7].strip().lower() == b"58b":
            body, end = find_binary_data(name, content, start)
            text, data = content[start:body], content[body : end.start()]
        else:
            end = _end_of_text(name, content, start)
            text = content[start : end.start()]
        head, _, lines = text.partition(b"\n")
        kind = int(head[:6]) if head[:6].strip().isdigit() else 0
        yield Block(number, kind, head, lines, data)
        position = end.end()
    if content[position:].strip():
        raise InputError(f"{path} holds text after record {number} that is no dataset: remove it")


def _end_of_text(name: str, content: bytes, start: int) -> re.Match[bytes]:
    """Return the end mark of an ASCII dataset."""
    end = _DATASET_MARK.search(content, start)
    if end is None:
        raise InputError(f"{name} has no end mark: the file is truncated; copy it again")
    return end


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


_BINARY_END_MARK = re.compile(rb"\s*?[ ]{4}-1[ ]*(\r?\n|\r?\Z)")
_LINES_BEFORE_BINARY = 12  # the line with the number of the dataset, and the header
_LINE_OF_FORM = 7  # of them, with the form and number of values
# Numbers of one point by ordinate data form and whether the axis is even; the usual ones first.
_LAYOUTS = {
    **{(2, True): ("f4", "f8"), (4, True): ("f8",)},
    **{(5, True): ("f4,f4", "f8,f8"), (6, True): ("f8,f8",)},
    **{(2, False): ("f4,f4", "f8,f8"), (4, False): ("f8,f8", "f4,f8")},
    **{(5, False): ("f4,f4,f4", "f8,f8,f8"), (6, False): ("f8,f8,f8", "f4,f8,f8")},
}


def find_binary_data(name: str, content: bytes, start: int) -> tuple[int, re.Match[bytes]]:
    """Return where the data of a dataset 58b begin, and the end mark after them.

    The mark follows the number of bytes that the header announces. Some writers miscount, so the
    number and size of the values is accepted too.

    Args:
        name: file and record, for messages.
        content: of the file.
        start: offset of the line with the number of the dataset.

    Raises:
        InputError: no end mark follows the data.
    """
    lines, data = [], start
    for _ in range(_LINES_BEFORE_BINARY):
        stop = content.find(b"\n", data) + 1
        if not stop:
            raise InputError(f"{name} is truncated in its header: copy or export the file again")
        lines.append(content[data:stop])
        data = stop
    try:
        announced, form = int(lines[0][31:43]), lines[_LINE_OF_FORM]
        kind, values, spacing = int(form[:10]), int(form[10:20]), int(form[20:30])
    except ValueError as error:
        raise InputError(
            f"{name}: the 58b header lacks the number of bytes and values: export it again"
        ) from error
    if min(announced, values) < 0:
        raise InputError(
            f"{name}: its header announces {announced} bytes and {values} values: export it again"
        )
    layouts = _LAYOUTS.get((kind, spacing == 1), ())
    for size in (announced, *(values * np.dtype(layout).itemsize for layout in layouts)):
        if size and (end := _BINARY_END_MARK.match(content, data + size)):
            return data, end
    available = len(content) - data
    if available < announced:
        raise InputError(
            f"{name} is truncated: its header announces {announced} bytes, but {available} follow; "
            "copy or export the file again"
        )
    raise InputError(
        f"{name}: no end mark follows the {announced} bytes that the 58b header announces: "
        "the file is truncated or miscounted; export it again"
    )


def read_points(data: bytes, order: str, form: int, count: int, *, is_even: bool) -> Real:
    """Return the numbers of each point of binary data; (n_point, n_number).

    Args:
        data: bytes between header and end mark.
        order: ``<`` or ``>``, the order of bytes.
        form: ordinate data form, one of 2, 4, 5 and 6.
        count: number of points that the header announces.
        is_even: whether the abscissa is even, and thus no part of the points.
    """
    layouts = [_point_type(layout, order) for layout in _LAYOUTS[form, is_even]]
    layout = next((kind for kind in layouts if kind.itemsize * count == len(data)), layouts[0])
    points = np.frombuffer(data, layout, len(data) // layout.itemsize)
    return np.column_stack([points[name] for name in layout.names or ()]).astype(np.float64)


def _point_type(layout: str, order: str) -> np.dtype:
    """Return the type of one point, with a named field for each number."""
    numbers = layout.split(",")
    return np.dtype([(f"number{k}", order + number) for k, number in enumerate(numbers)])
