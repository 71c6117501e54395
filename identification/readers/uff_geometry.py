"""Datasets of universal files on units and geometry: 164, 15, 2411 and 2420."""

from typing import Any

import numpy as np

from identification.readers.uff_blocks import Block
from identification.readers.uff_fields import parse_number, parse_numbers

_NUMBERS_PER_NODE = 7  # number, two coordinate systems, colour, position
_LINES_PER_SYSTEM, _NUMBERS_PER_SYSTEM = 6, 3  # of a coordinate system; label, type and colour


def read_units(block: Block) -> dict[str, Any]:
    """Return the unit factors of length and force of a dataset 164.

    Raises:
        ValueError: there are no such numbers.
    """
    length, force, *_ = map(float, parse_numbers(block.lines()[1:]))
    return {"type": block.kind, "length": length, "force": force}


def read_node_table(block: Block) -> dict[str, Any]:
    """Return numbers, coordinate systems of displacements and positions of a dataset 15 or 2411.

    Raises:
        ValueError: a number is malformed or missing.
    """
    fields = [field for line in block.lines() for field in line.split()]
    starts = range(0, len(fields), _NUMBERS_PER_NODE)
    rows = [fields[start : start + _NUMBERS_PER_NODE] for start in starts]
    if len(fields) % _NUMBERS_PER_NODE:
        raise ValueError("a node has other than seven numbers")
    positions = np.array([[parse_number(field) for field in row[4:]] for row in rows], float)
    if not np.isfinite(positions).all():
        raise ValueError("a node holds NaN or infinity")
    return {
        "type": block.kind,
        "node_nums": np.array([int(row[0]) for row in rows], np.intp),
        "disp_cs": np.array([int(row[2]) for row in rows], np.intp),
        "positions": positions.reshape(-1, 3),
    }


def read_coordinate_systems(block: Block) -> dict[str, Any]:
    """Return labels and axes of the coordinate systems of a dataset 2420.

    The axes are rows of a matrix; (3, 3).

    Raises:
        ValueError: a number is malformed or missing.
    """
    lines = [line for line in block.lines()[2:] if line.strip()]
    labels, axes = [], []
    for start in range(0, len(lines), _LINES_PER_SYSTEM):
        label, _, _ = map(int, lines[start].split())
        labels.append(label)
        matrix = parse_numbers(lines[start + 2 : start + _LINES_PER_SYSTEM])
        axes.append(matrix.reshape(4, _NUMBERS_PER_SYSTEM)[:3])
    return {"type": block.kind, "labels": labels, "axes": axes}
