"""Mode shapes from universal files: datasets 55, or 2414 if there are none; real or complex."""

from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import Node, Record, read_nodes, read_records
from identification.readers.uff_modes_write import NodeShapes
from identification.words import Complex, InputError, Integers, Real

_NORMAL_MODE, _COMPLEX_MODES = 2, (3, 7)  # analysis types
_Mode = tuple[complex, complex, Integers, Complex]  # pole, a_r, node numbers, values


def read_uff_modes(path: Path) -> NodeShapes:
    """Read the modes of a universal file.

    The poles of normal modes (analysis type 2) come from frequency and viscous damping.
    Translations are read along world axes; a file whose nodes have rotated coordinate systems is
    refused.

    Raises:
        InputError: there is no mode, modes have different nodes, or a coordinate system is rotated.
    """
    records = read_records(path)
    positions = read_nodes(path, records)
    modes = _modes(records, 55) or _modes(records, 2414)
    if not modes:
        raise InputError(
            f"{path} holds no mode shape: export datasets 55 or 2414, analysis type 2 or 3"
        )
    first_number, (_, _, nodes, _) = modes[0]
    for number, (_, _, mode_nodes, _) in modes:
        if not np.array_equal(mode_nodes, nodes):
            raise InputError(
                f"{path}: records {first_number} and {number} have different nodes: export all "
                "modes at the same nodes"
            )
    return NodeShapes(
        np.array([mode[0] for _, mode in modes]),
        np.array([mode[1] for _, mode in modes]),
        nodes,
        _positions(path, positions, nodes, _rotated_systems(records)),
        np.stack([mode[3] for _, mode in modes], axis=-1),
    )


def _modes(records: list[tuple[int, Record]], kind: int) -> list[tuple[int, _Mode]]:
    """Return the modes among the datasets of one kind, each with its record number."""
    read = _mode if kind == 55 else _mode_2414
    modes = [(number, read(record)) for number, record in records if record.get("type") == kind]
    return [(number, mode) for number, mode in modes if mode is not None]


def _mode(record: Record) -> _Mode | None:
    """Return pole, a_r, nodes and values of a dataset 55; None if it is not a mode."""
    kind = record.get("analysis_type")
    if kind == _NORMAL_MODE:
        pole = _pole(record["freq"], record["modal_damp_vis"])
        scale = 2j * pole.imag * record["modal_m"]
    elif kind in _COMPLEX_MODES:
        pole, scale = complex(record["eig"]), complex(record["modal_a"])
    else:
        return None
    values = np.column_stack([record["r1"], record["r2"], record["r3"]]).astype(complex)
    return pole, scale, np.asarray(record["node_nums"], np.intp), values


def _mode_2414(record: Record) -> _Mode | None:
    """Return pole, a_r, nodes and values of a dataset 2414; None if it is not a mode."""
    kind = record.get("analysis_type")
    if (kind != _NORMAL_MODE and kind not in _COMPLEX_MODES) or record.get("dataset_location") != 1:
        return None
    first = [float(record.get(f"record12_field{k}", 0.0)) for k in range(1, 7)]
    second = [float(record.get(f"record13_field{k}", 0.0)) for k in range(1, 7)]
    if kind == _NORMAL_MODE:
        pole = _pole(first[1], first[4])
        scale = 2j * pole.imag * first[3]
    else:
        pole, scale = complex(*second[:2]), complex(*second[2:4])
    data = np.asarray(record["data_at_node"], float)
    if record["data_type"] in (5, 6):
        data = data[:, 0::2] + 1j * data[:, 1::2]
    return pole, scale, np.asarray(record["node_nums"], np.intp), data[:, :3].astype(complex)


def _pole(freq_hz: float, damping: float) -> complex:
    """Return the pole w (-zeta + i sqrt(1 - zeta^2)) [rad/s]."""
    size = 2 * np.pi * freq_hz
    return complex(-damping * size, size * np.sqrt(max(0.0, 1 - damping**2)))


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
        if record.get("type") == 2420:
            systems, matrices = record["CS_sys_labels"], record["CS_matrices"]
            for label, matrix in zip(systems, matrices, strict=True):
                if not np.allclose(np.asarray(matrix, float)[:3], np.eye(3), atol=1e-6):
                    rotated.add(int(label))
    return rotated
