"""Mode shapes from universal files: datasets 55, or 2414 if there are none; real or complex."""

from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import (
    NODE_DATASETS,
    SYSTEMS_DATASET,
    UNITS_DATASET,
    Node,
    Record,
    read_nodes,
    read_records,
)
from identification.readers.uff_modes_write import NodeShapes
from identification.words import InputError, Integers, Real

_MAX_AXIS_DEVIATION = 1e-6  # of the entries of a matrix of axes: rounding, and no rotation


def read_uff_modes(path: Path) -> NodeShapes:
    """Read the modes of a universal file.

    The poles of normal modes (analysis type 2) come from frequency and viscous damping.
    Translations are read along world axes; a file whose nodes have rotated coordinate systems is
    refused.

    Raises:
        InputError: there is no mode, modes have different nodes, or a coordinate system is rotated.
    """
    geometry, _ = read_records(path, (*NODE_DATASETS, UNITS_DATASET, SYSTEMS_DATASET))
    positions = read_nodes(path, geometry)
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
    return NodeShapes(
        np.array([mode["pole"] for _, mode in modes]),
        np.array([mode["modal_a"] for _, mode in modes]),
        nodes,
        _positions(path, positions, nodes, _rotated_systems(geometry)),
        np.stack([mode["values"] for _, mode in modes], axis=-1),
    )


def _read_modes(path: Path, kind: int) -> list[tuple[int, Record]]:
    """Read the modes among the datasets of one kind, each with its record number."""
    return [(number, mode) for number, mode in read_records(path, (kind,))[0] if mode["is_mode"]]


def _positions(path: Path, known: list[Node], nodes: Integers, rotated: set[int]) -> Real:
    """Return the positions of nodes [m], zero if unknown; (n_node, 3)."""
    positions = np.zeros((len(nodes), 3))
    rows = {int(node): row for row, node in enumerate(nodes)}
    for node in known:
        if node.number not in rows:
            continue
        positions[rows[node.number]] = node.position
        if node.system in rotated:
            raise InputError(
                f"{path}, record {node.record}: node {node.number} has the rotated coordinate "
                f"system {node.system}: export shapes in global axes"
            )
    return positions


def _rotated_systems(records: list[tuple[int, Record]]) -> set[int]:
    """Return the numbers of coordinate systems (datasets 2420) rotated against world axes."""
    rotated = set()
    for _, record in records:
        if record["type"] == SYSTEMS_DATASET:
            for label, matrix in zip(record["labels"], record["axes"], strict=True):
                if not np.allclose(matrix, np.eye(3), atol=_MAX_AXIS_DEVIATION):
                    rotated.add(label)
    return rotated
