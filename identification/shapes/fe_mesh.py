"""Mesh and point data of a finite-element file, read in a process of its own."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.readers.child_process import read_in_child
from identification.words import MAX_INPUT_MAGNITUDE, InputError, Integers, Real
from identification.words.file_access import check_file

_MESH_SCRIPT = Path(__file__).with_name("fe_mesh_child.py")
_AXES_OF_POINTS = 3


@dataclass(frozen=True, eq=False)
class FeMesh:
    """Points, cells and point data of a file.

    Args:
        points: [m]; (n_point, 3).
        cells: kind of cell by meshio's name, and its corners; (n_cell, n_corner) each.
        data: point data by name; the first axis is n_point.
        remarks: sentences on what was left out.
    """

    points: Real
    cells: tuple[tuple[str, Integers], ...]
    data: dict[str, Real]
    remarks: tuple[str, ...] = ()


def read_fe_mesh(path: Path) -> FeMesh:
    """Read a mesh by meshio, or a MED file by h5py.

    Fields of MED files on cells are left out. If fields sit on a part of the nodes (a profile), the
    other nodes and their cells are left out as well.

    Raises:
        InputError: no such file, or no mesh in it.
    """
    if not os.path.exists(path):
        raise InputError(f"{path} is not there. Give a mesh file with shapes as point data.")
    check_file(path, "give a mesh file with shapes as point data")
    try:
        arrays = read_in_child(_MESH_SCRIPT, path)
        return _assemble(path, arrays)
    except ValueError as error:
        raise InputError(
            f"{path} cannot be read as a mesh ({error}). "
            "Give VTU, MED, XDMF or another format of meshio."
        ) from error


def _assemble(path: Path, arrays: dict[str, np.ndarray]) -> FeMesh:
    """Return the mesh of the arrays that the child process read, each checked."""
    given = arrays["points"]
    if given.ndim != 2 or not len(given) or given.shape[1] > _AXES_OF_POINTS:
        raise ValueError("it has no points of two or three coordinates")
    if not (np.abs(given) <= MAX_INPUT_MAGNITUDE).all():  # also false for NaN
        raise ValueError("a coordinate is no number")
    points = np.zeros((len(given), _AXES_OF_POINTS))
    points[:, : given.shape[1]] = given
    cells = []
    for name, block in _entries(arrays, "cells/"):
        if not block.size:
            continue
        kind = name.partition("/")[2]
        if block.ndim != 2 or not 0 <= block.min() <= block.max() < len(points):
            raise ValueError(f"a {kind} names a point that does not exist")
        cells.append((kind, np.asarray(block, np.intp)))
    data = {}
    for name, values in _entries(arrays, "data/"):
        if values.dtype.kind in "fiu":
            data[name] = values.astype(float)
        if len(values) != len(points):
            raise ValueError(f"{name} has {len(values)} values for {len(points)} points")
    remarks = [
        f"{path.name}: {name} has values on cells and not at nodes, and is left out"
        for name, _ in _entries(arrays, "left_out/")
    ]
    mesh = FeMesh(points, tuple(cells), data, tuple(remarks))
    absent = arrays.get("absent")
    return mesh if absent is None or not absent.any() else _without_points(path, mesh, absent)


def _entries(arrays: dict[str, np.ndarray], prefix: str) -> list[tuple[str, np.ndarray]]:
    """Return the arrays whose names begin with a prefix, by the rest of their names."""
    return [
        (name.removeprefix(prefix), values)
        for name, values in arrays.items()
        if name.startswith(prefix)
    ]


def _without_points(path: Path, mesh: FeMesh, absent: np.ndarray) -> FeMesh:
    """Return a mesh without some points and the cells that use them."""
    number = np.cumsum(~absent) - 1
    cells = tuple(
        (kind, number[corners[~absent[corners].any(axis=1)]]) for kind, corners in mesh.cells
    )
    remark = (
        f"{path.name}: {absent.sum()} of {len(absent)} nodes lie outside the profile of the shapes "
        "and are left out with their cells"
    )
    data = {name: values[~absent] for name, values in mesh.data.items()}
    return FeMesh(mesh.points[~absent], cells, data, (*mesh.remarks, remark))
