"""Mode shapes of universal files: datasets 55 and 2414."""

from typing import Any

import numpy as np

from identification.readers.uff_blocks import Block, parse_number, split_fields
from identification.words import Integers, Real

_NORMAL_MODE, _COMPLEX_MODES = 2, (3, 7)  # analysis types
_COMPLEX_DATA = (5, 6)  # data types
_AT_NODES = 1  # location of the values of a dataset 2414
_NUMBER_WIDTHS = (13,) * 6
_KIND_WIDTHS = (10,) * 6


def read_shape_55(block: Block) -> dict[str, Any]:
    """Return pole, modal a, nodes and values of a dataset 55, if it is a mode.

    Raises:
        ValueError: a number is malformed or missing.
        IndexError: lines are missing.
    """
    lines = block.lines()
    kinds = [int(field) for field in split_fields(lines[5], _KIND_WIDTHS)]
    if kinds[1] == _NORMAL_MODE:
        freq_hz, mass, damping, *_ = _numbers(lines[7])
        pole, scale = _normal_mode(freq_hz, damping, mass)
    elif kinds[1] in _COMPLEX_MODES:
        numbers = _numbers(lines[7])
        pole, scale = complex(*numbers[:2]), complex(*numbers[2:4])
    else:
        return {"type": block.kind, "is_mode": False}
    return _mode(block, pole, scale, lines[8:], kinds)


def read_shape_2414(block: Block) -> dict[str, Any]:
    """Return pole, modal a, nodes and values of a dataset 2414, if it is a mode at nodes.

    Raises:
        ValueError: a number is malformed or missing.
        IndexError: lines are missing.
    """
    lines = block.lines()
    kinds = [int(field) for field in split_fields(lines[8], _KIND_WIDTHS)]
    is_normal = kinds[1] == _NORMAL_MODE
    if not (is_normal or kinds[1] in _COMPLEX_MODES) or int(lines[2]) != _AT_NODES:
        return {"type": block.kind, "is_mode": False}
    first, second = _numbers(lines[11]), _numbers(lines[12])
    if is_normal:
        pole, scale = _normal_mode(first[1], first[4], first[3])
    else:
        pole, scale = complex(*second[:2]), complex(*second[2:4])
    return _mode(block, pole, scale, lines[13:], kinds)


def _numbers(line: str) -> list[float]:
    """Return the six numbers of a line; empty fields are 0."""
    return [parse_number(field or "0") for field in split_fields(line, _NUMBER_WIDTHS)]


def _normal_mode(freq_hz: float, damping: float, mass: float) -> tuple[complex, complex]:
    """Return the pole w (-zeta + i sqrt(1 - zeta^2)) [rad/s] and modal a of a normal mode."""
    size = 2 * np.pi * freq_hz
    pole = complex(-damping * size, size * np.sqrt(max(0.0, 1 - damping**2)))
    return pole, 2j * pole.imag * mass


def _mode(
    block: Block, pole: complex, scale: complex, lines: list[str], kinds: list[int]
) -> dict[str, Any]:
    """Return a mode, whose translations at each node follow the number of the node.

    Args:
        block: the dataset.
        pole: [rad/s].
        scale: modal a of receptance [kg/s].
        lines: of node numbers and values.
        kinds: model, analysis, characteristic, result and data type, and number of values.
    """
    is_complex, count = kinds[4] in _COMPLEX_DATA, kinds[5]
    if count < 3:
        raise ValueError("its values are not displacements in three directions")
    nodes, rows = _node_values(lines, count * (1 + is_complex))
    if not (np.isfinite(rows).all() and np.isfinite([pole, scale]).all()):
        raise ValueError("it holds NaN or infinity")
    values = rows[:, 0:6:2] + 1j * rows[:, 1:6:2] if is_complex else rows[:, :3].astype(complex)
    return {
        "type": block.kind,
        "is_mode": True,
        "pole": pole,
        "modal_a": scale,
        "node_nums": nodes,
        "values": values,
    }


def _node_values(lines: list[str], count: int) -> tuple[Integers, Real]:
    """Return node numbers, and the values that follow each on one or more lines.

    Args:
        lines: a line with the number of a node, then lines with its values.
        count: values of a node.

    Raises:
        ValueError: a number is malformed, or a node has more or fewer values.
    """
    nodes: list[int] = []
    values: list[float] = []
    for line in lines:
        fields = line.split()
        if len(values) < count * len(nodes):
            values += map(parse_number, fields)
        elif fields:
            nodes.append(int(fields[0]))
        if len(values) > count * len(nodes):
            break
    return np.array(nodes, np.intp), np.array(values, float).reshape(len(nodes), count)
