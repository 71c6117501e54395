"""Mode shapes from universal files: datasets 55, else 2414, real or complex."""

from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import Node, Record, nodes_of, read_records
from identification.readers.uff_modes_write import NodeShapes
from identification.words import Complex, InputError, Integers, Real

_NORMAL, _COMPLEX = 2, (3, 7)
_Mode = tuple[complex, complex, Integers, Complex]


def read_uff_modes(path: Path) -> NodeShapes:
    """Read the modes of a universal file.

    Normal modes (analysis type 2) become poles by frequency and viscous damping. Translations are
    taken as along world axes: a file whose nodes move in turned systems of their own is refused.

    Raises:
        InputError: no mode, modes with different nodes, turned coordinate systems.
    """
    records = read_records(path)
    known = nodes_of(path, records)
    modes = _modes(records, 55) or _modes(records, 2414)
    if not modes:
        raise InputError(
            f"{path} holds no mode shape: export datasets 55 or 2414, analysis type 2 or 3"
        )
    first_number, (_, _, nodes, _) = modes[0]
    for number, (_, _, others, _) in modes:
        if not np.array_equal(others, nodes):
            raise InputError(
                f"{path}: records {first_number} and {number} have different nodes: export all "
                "modes at the same nodes"
            )
    return NodeShapes(
        np.array([mode[0] for _, mode in modes]),
        np.array([mode[1] for _, mode in modes]),
        nodes,
        _places(path, known, nodes, _turned_systems(records)),
        np.stack([mode[3] for _, mode in modes], axis=-1),
    )


def _modes(records: list[tuple[int, Record]], kind: int) -> list[tuple[int, _Mode]]:
    """The modes among the datasets of one kind, each with the number of its record."""
    read = _mode if kind == 55 else _mode_2414
    found = [(number, read(record)) for number, record in records if record.get("type") == kind]
    return [(number, mode) for number, mode in found if mode is not None]


def _mode(record: Record) -> _Mode | None:
    """Pole, a_r, nodes and values of a dataset 55; None if it is no mode."""
    kind = record.get("analysis_type")
    if kind == _NORMAL:
        pole = _pole(record["freq"], record["modal_damp_vis"])
        scale = 2j * pole.imag * record["modal_m"]
    elif kind in _COMPLEX:
        pole, scale = complex(record["eig"]), complex(record["modal_a"])
    else:
        return None
    values = np.column_stack([record["r1"], record["r2"], record["r3"]]).astype(complex)
    return pole, scale, np.asarray(record["node_nums"], np.intp), values


def _mode_2414(record: Record) -> _Mode | None:
    kind = record.get("analysis_type")
    if (kind != _NORMAL and kind not in _COMPLEX) or record.get("dataset_location") != 1:
        return None
    first = [float(record.get(f"record12_field{k}", 0.0)) for k in range(1, 7)]
    second = [float(record.get(f"record13_field{k}", 0.0)) for k in range(1, 7)]
    if kind == _NORMAL:
        pole = _pole(first[1], first[4])
        scale = 2j * pole.imag * first[3]
    else:
        pole, scale = complex(*second[:2]), complex(*second[2:4])
    data = np.asarray(record["data_at_node"], float)
    if record["data_type"] in (5, 6):
        data = data[:, 0::2] + 1j * data[:, 1::2]
    return pole, scale, np.asarray(record["node_nums"], np.intp), data[:, :3].astype(complex)


def _pole(freq_hz: float, damping: float) -> complex:
    size = 2 * np.pi * freq_hz
    return complex(-damping * size, size * np.sqrt(max(0.0, 1 - damping**2)))


def _places(path: Path, known: list[Node], nodes: Integers, turned: set[int]) -> Real:
    """Positions of nodes [m], zero where unknown; (n_node, 3)."""
    places = np.zeros((len(nodes), 3))
    rows = {int(node): row for row, node in enumerate(nodes)}
    for node in known:
        if node.number not in rows:
            continue
        places[rows[node.number]] = node.place
        if node.system in turned:
            raise InputError(
                f"{path}, record {node.record}: node {node.number} moves in the turned system "
                f"{node.system}: export shapes in global axes"
            )
    return places


def _turned_systems(records: list[tuple[int, Record]]) -> set[int]:
    """Numbers of the coordinate systems of datasets 2420 that are not those of the world."""
    turned = set()
    for _, record in records:
        if record.get("type") == 2420:
            systems, matrices = record["CS_sys_labels"], record["CS_matrices"]
            for label, matrix in zip(systems, matrices, strict=True):
                if not np.allclose(np.asarray(matrix, float)[:3], np.eye(3), atol=1e-6):
                    turned.add(int(label))
    return turned
