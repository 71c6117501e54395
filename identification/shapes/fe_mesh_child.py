"""Script for a child process that reads a finite-element mesh with point data.

MED files are read by h5py, since their fields may sit on cells or on a part of the nodes. Other
formats are read by meshio, which prints errors and may end the program. Steps of an XDMF series and
of MED fields get names that end in their value.
"""

from collections.abc import Iterator
from pathlib import Path

import h5py
import meshio
import numpy as np

# Kinds of cells of MED by meshio's names; their corners are numbered alike.
_CELLS_OF_MED = {
    **{"SE2": "line", "SE3": "line3", "TR3": "triangle", "TR6": "triangle6", "QU4": "quad"},
    **{"QU8": "quad8", "QU9": "quad9", "TE4": "tetra", "T10": "tetra10", "HE8": "hexahedron"},
    **{"H20": "hexahedron20", "H27": "hexahedron27", "PY5": "pyramid", "P13": "pyramid13"},
    **{"PE6": "wedge", "P15": "wedge15"},
}
_WHOLE_PROFILE = "MED_NO_PROFILE_INTERNAL"


def read(path: Path, max_array_bytes: int) -> dict[str, np.ndarray]:
    """Read points, cells and point data.

    Args:
        path: the mesh file.
        max_array_bytes: bytes that the arrays may take in memory.

    Returns:
        ``points``, ``cells/<number>/<kind>``, ``data/<name>``, and an empty ``left_out/<name>`` for
        each field that has no values at points. ``absent`` tells points without values.

    Raises:
        ValueError: the file is no such mesh, or too large.
    """
    if path.suffix.lower() in {".med", ".mmed", ".rmed"}:
        with h5py.File(path, "r") as file:
            return _read_med(file, max_array_bytes)
    mesh = _read_series(path) if _is_series(path) else meshio.read(path)
    cells = {f"cells/{k}/{b.type}": np.asarray(b.data) for k, b in enumerate(mesh.cells)}
    numeric = {name: block for name, block in cells.items() if block.dtype.kind in "iu"}
    data = {f"data/{name}": np.asarray(values) for name, values in mesh.point_data.items()}
    return {"points": np.asarray(mesh.points, float), **numeric, **data}


def _is_series(path: Path) -> bool:
    """Return whether an XDMF file holds steps, each with a value."""
    return path.suffix in {".xdmf", ".xmf"} and 'CollectionType="Temporal"' in path.read_text(
        "utf-8", errors="replace"
    )


def _read_series(path: Path) -> meshio.Mesh:
    """Read the mesh of a series, and the data of each step, whose value is its frequency."""
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, cells = reader.read_points_cells()
        shapes = {}
        for step in range(reader.num_steps):
            value, data, _ = reader.read_data(step)
            for name, values in data.items():
                shapes[f"{name}[{step}] - {float(value)!r}"] = values
    return meshio.Mesh(points, cells, point_data=shapes)


def _read_med(file: h5py.File, max_array_bytes: int) -> dict[str, np.ndarray]:
    """Read the mesh of a MED file, and its fields at nodes."""
    names: list[str] = []

    def collect(name: bytes, link: h5py.h5l.LinkInfo) -> None:
        if link.type != h5py.h5l.TYPE_HARD:
            names.append(name.decode(errors="replace"))

    file.id.links.visit(collect, info=True)
    if names:
        raise ValueError(f"{names[0]} is a link, which may leave the file")
    meshes = list(file["ENS_MAA"])
    if len(meshes) != 1:
        raise ValueError(f"it holds {len(meshes)} meshes: export one")
    mesh = file["ENS_MAA"][meshes[0]]
    dimension = int(mesh.attrs["ESP"])
    if "NOE" not in mesh:  # the mesh of a time step
        steps = list(mesh)
        if len(steps) != 1:
            raise ValueError(f"its mesh has {len(steps)} steps: export one")
        mesh = mesh[steps[0]]
    reader = _Med(file, max_array_bytes)
    points = reader.table(mesh["NOE"]["COO"], dimension)
    arrays = {"points": points.astype(float)}
    for kind, group in mesh["MAI"].items():
        if kind in _CELLS_OF_MED:
            count = int(group["NOD"].attrs["NBR"])
            values = reader.values(group["NOD"])
            corners = values.reshape((count, -1), order="F") - 1
            arrays[f"cells/{len(arrays)}/{_CELLS_OF_MED[kind]}"] = corners
    return arrays | reader.read_fields(len(points))


class _Med:
    """Arrays of a MED file, whose sizes are added up before they are read."""

    def __init__(self, file: h5py.File, max_array_bytes: int) -> None:
        self.file = file
        self.free_bytes = max_array_bytes

    def values(self, item: h5py.Dataset) -> np.ndarray:
        """Return the values of a dataset, which has to be part of the file."""
        self.free_bytes -= item.size * item.dtype.itemsize
        if item.external or item.is_virtual or item.dtype.kind not in "fiu":
            raise ValueError(f"{item.name} holds no numbers of this file")
        if self.free_bytes < 0:
            raise ValueError("it announces arrays far larger than it can hold")
        return np.asarray(item[()]).ravel()

    def table(self, item: h5py.Dataset, columns: int) -> np.ndarray:
        """Return values as a table, one column after the other in the file; (n, columns)."""
        return self.values(item).reshape((-1, columns), order="F")

    def read_fields(self, count: int) -> dict[str, np.ndarray]:
        """Return the fields at nodes by name, and the names of the others."""
        arrays: dict[str, np.ndarray] = {}
        absent = np.zeros(count, bool)
        for field_name, field in self.file.get("CHA", {}).items():
            for name, step in _named_steps(field_name, field):
                if "NOE" not in step:
                    arrays[f"left_out/{field_name}"] = np.empty(0)
                    continue
                values, rows = self._nodal_values(step["NOE"], int(field.attrs["NCO"]), count)
                arrays[f"data/{name}"] = np.zeros((count, values.shape[1]))
                arrays[f"data/{name}"][rows] = values
                if values.shape[1] >= 3:
                    absent |= ~np.isin(np.arange(count), rows)
        return {**arrays, "absent": absent}

    def _nodal_values(
        self, group: h5py.Group, components: int, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return values at nodes, and the rows of these nodes.

        Args:
            group: of one step at nodes.
            components: of the field.
        """
        profile = group.attrs.get("PFL", _WHOLE_PROFILE)
        profile = profile.decode() if isinstance(profile, bytes) else str(profile)
        values = self.table(group[profile]["CO"], components)
        rows = np.arange(count)
        if profile != _WHOLE_PROFILE:
            rows = self.values(self.file["PROFILS"][profile]["PFL"]) - 1
        if len(rows) != len(values) or (rows.size and not 0 <= rows.min() <= rows.max() < count):
            raise ValueError(f"{group.name} has {len(values)} values for {len(rows)} nodes")
        return values, rows


def _named_steps(name: str, field: h5py.Group) -> Iterator[tuple[str, h5py.Group]]:
    """Yield the steps of a field; of several steps, each name ends in the value of its step."""
    steps = sorted(field)
    for number, key in enumerate(steps):
        value = field[key].attrs["PDT"]
        yield (name if len(steps) == 1 else f"{name}[{number}] - {value:g}"), field[key]
