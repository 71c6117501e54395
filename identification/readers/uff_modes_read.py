"""Mode shapes from universal files: datasets 55, or 2414 if there are none; real or complex."""

from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import Record, read_records
from identification.readers.uff_modes_write import NodeShapes
from identification.readers.uff_nodes import read_nodes
from identification.words import InputError


def read_uff_modes(path: Path) -> NodeShapes:
    """Read the modes of a universal file.

    The poles of normal modes (analysis type 2) come from frequency and viscous damping.
    Translations along the axes of the displacement systems of the nodes become translations along
    world axes.

    Raises:
        InputError: there is no mode, or modes have different nodes.
    """
    table = read_nodes(path)
    modes = _read_modes(path, 55) or _read_modes(path, 2414)
    if not modes:
        raise InputError(
            f"{path} holds no mode shape: export datasets 55 or 2414, analysis type 2 or 3"
        )
    first_number, first = modes[0]
    nodes = first["node_nums"]
    for number, mode in modes:
        if not np.array_equal(mode["node_nums"], nodes):
            raise InputError(
                f"{path}: records {first_number} and {number} have different nodes: export all "
                "modes at the same nodes"
            )
    positions, values = np.zeros((len(nodes), 3)), np.stack([m["values"] for _, m in modes], -1)
    for row, number in enumerate(nodes):
        node = table.nodes.get(int(number))
        if node is not None:
            positions[row], values[row] = node.position, node.axes @ values[row]
    return NodeShapes(
        np.array([mode["pole"] for _, mode in modes]),
        np.array([mode["modal_a"] for _, mode in modes]),
        nodes,
        positions,
        values,
        remarks=table.remarks,
    )


def _read_modes(path: Path, kind: int) -> list[tuple[int, Record]]:
    """Read the modes among the datasets of one kind, each with its record number."""
    return [(number, mode) for number, mode in read_records(path, (kind,))[0] if mode["is_mode"]]
