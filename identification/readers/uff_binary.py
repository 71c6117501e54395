"""Binary data of datasets 58b: where they end, and their points.

The bytes of one point follow from the ordinate data form and the spacing of the abscissa. Writers
deviate: some write values of single precision in double precision, some write the abscissa of
double-precision values in single precision. What was written shows in the number of bytes.
"""

import re

import numpy as np

from identification.words import InputError, Real

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
