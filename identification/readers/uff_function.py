"""Functions of universal files: datasets 58 (ASCII) and 58b (binary)."""

from typing import Any

import numpy as np

from identification.readers.uff_blocks import (
    Block,
    FieldError,
    parse_columns,
    parse_integer,
    parse_number,
    read_points,
    split_fields,
)
from identification.words import Real

_HEADER_LINES = 11  # after the line with the number of the dataset
_DOF_LINE, _FORM_LINE, _AXIS_LINES = 5, 6, {"abscissa": 7, "ordinate": 8, "orddenom": 9}
_DOF_WIDTHS = (5, 10, 5, 10, 11, 10, 4, 11, 10, 4)
_FORM_WIDTHS = (10, 10, 10, 13, 13, 13)
_AXIS_WIDTHS = (10, 5, 5, 5, 21, 21)
_HEAD_WIDTHS_58B = (7, 6, 6, 12, 12)
_COMPLEX_FORMS, _DOUBLE_FORMS = (5, 6), (4, 6)
_OTHER_PRECISION = {2: 4, 4: 2, 5: 6, 6: 5}
# Columns of ASCII values by ordinate data form and whether the axis is even.
_SINGLE_COLUMNS, _DOUBLE_COLUMNS = (13,) * 6, (20,) * 4
_COLUMNS = {
    **{(2, True): _SINGLE_COLUMNS, (2, False): _SINGLE_COLUMNS},
    **{(5, True): _SINGLE_COLUMNS, (5, False): _SINGLE_COLUMNS},
    **{(4, True): _DOUBLE_COLUMNS, (6, True): _DOUBLE_COLUMNS},
    **{(4, False): (13, 20, 13, 20), (6, False): (13, 20, 20)},
}


def function_type(block: Block) -> int | None:
    """Return the function type of a dataset 58; None if its header holds none."""
    lines = block.text.split(b"\n", _DOF_LINE + 1)
    text = lines[_DOF_LINE][:5].strip() if len(lines) > _DOF_LINE else b""
    return int(text) if text.isdigit() else None


def read_function(block: Block) -> dict[str, Any]:
    """Return header and values of a dataset 58 by the names of its fields.

    ``x`` and ``data`` are absent if the ordinate data form is unknown.

    Raises:
        ValueError: a field is malformed.
        IndexError: lines are missing.
    """
    lines = block.lines()
    record = {"type": block.kind, "binary": int(block.data is not None)} | _read_header(lines)
    order = ">"
    if block.data is not None:
        fields = split_fields(block.head.decode("utf-8", "replace"), _HEAD_WIDTHS_58B)
        order = "<" if fields[1] == "1" else ">"
        record["fp_format"] = parse_integer(fields[2])
    form, is_even = record["ord_data_type"], record["abscissa_spacing"] == 1
    columns = _COLUMNS.get((form, is_even))
    if columns is None:
        return record
    if block.data is None:
        numbers = _parse_values(lines[_HEADER_LINES:], form, is_even=is_even)
        points = numbers.reshape(-1, 2 - is_even + (form in _COMPLEX_FORMS))
    else:
        points = read_points(block.data, order, form, record["num_pts"], is_even=is_even)
    if is_even:
        record["x"] = record["abscissa_min"] + np.arange(len(points)) * record["abscissa_inc"]
    else:
        record["x"], points = points[:, 0].copy(), points[:, 1:]
    is_complex = form in _COMPLEX_FORMS
    record["data"] = np.ascontiguousarray(points).view(complex if is_complex else float)[:, 0]
    return record


def _parse_values(lines: list[str], form: int, *, is_even: bool) -> Real:
    """Return the values of an ASCII dataset 58 in their order.

    Raises:
        FieldError: the values have the width of the other precision than the header states.
        ValueError: a value is malformed.
    """
    try:
        return parse_columns(lines, _COLUMNS[form, is_even])
    except ValueError as error:
        actual_form = _OTHER_PRECISION[form]
        try:
            parse_columns(lines, _COLUMNS[actual_form, is_even])
        except ValueError:
            raise error from None
        stated, width = ("double", 13) if form in _DOUBLE_FORMS else ("single", 20)
        raise FieldError(
            f"states {stated} precision (data type {form}), but its values are {width} characters "
            f"wide as those of data type {actual_form}"
        ) from error


def _read_header(lines: list[str]) -> dict[str, Any]:
    """Return the fields of the header that readers use."""
    dof = split_fields(lines[_DOF_LINE], _DOF_WIDTHS)
    form = split_fields(lines[_FORM_LINE], _FORM_WIDTHS)
    header: dict[str, Any] = {
        "func_type": int(dof[0]),
        "load_case_id": parse_integer(dof[3]),
        "rsp_node": parse_integer(dof[5]),
        "rsp_dir": parse_integer(dof[6]),
        "ref_node": parse_integer(dof[8]),
        "ref_dir": parse_integer(dof[9]),
        "ord_data_type": int(form[0]),
        "num_pts": int(form[1]),
        "abscissa_spacing": int(form[2]),
        "abscissa_min": parse_number(form[3] or "0"),
        "abscissa_inc": parse_number(form[4] or "0"),
        "z_axis_value": parse_number(form[5] or "0"),
    }
    for axis, line in _AXIS_LINES.items():
        kind, *_, label, unit = split_fields(lines[line], _AXIS_WIDTHS)
        header |= {
            f"{axis}_spec_data_type": parse_integer(kind),
            f"{axis}_axis_lab": label,
            f"{axis}_axis_units_lab": unit,
        }
    return header
