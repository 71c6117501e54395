"""Datasets of universal files on units and nodes: 164, 15 and 2411."""

from typing import Any

import numpy as np

from identification.readers.uff_blocks import Block
from identification.readers.uff_fields import parse_number, parse_numbers
from identification.words import MAX_INPUT_MAGNITUDE

_NUMBERS_PER_NODE = 7  # number, two coordinate systems, colour, position


def read_units(block: Block) -> dict[str, Any]:
    """Return the unit factors of length and force of a dataset 164.

    Raises:
        ValueError: there are no such numbers.
    """
    length, force, *_ = map(float, parse_numbers(block.lines()[1:]))
    return {"type": block.kind, "length": length, "force": force}


def read_node_table(block: Block) -> dict[str, Any]:
    """Return numbers, coordinate systems and coordinates of the nodes of a dataset 15 or 2411.

    Raises:
        ValueError: a number is malformed or missing.
    """
    fields = [field for line in block.lines() for field in line.split()]
    starts = range(0, len(fields), _NUMBERS_PER_NODE)
    rows = [fields[start : start + _NUMBERS_PER_NODE] for start in starts]
    if len(fields) % _NUMBERS_PER_NODE:
        raise ValueError("a node has other than seven numbers")
    coordinates = np.array([[parse_number(field) for field in row[4:]] for row in rows], float)
    if not (np.abs(coordinates) <= MAX_INPUT_MAGNITUDE).all():
        raise ValueError("a node holds NaN or absurd numbers")
    return {
        "type": block.kind,
        "node_nums": np.array([int(row[0]) for row in rows], np.intp),
        "def_cs": np.array([int(row[1]) for row in rows], np.intp),
        "disp_cs": np.array([int(row[2]) for row in rows], np.intp),
        "coordinates": coordinates.reshape(-1, 3),
    }
