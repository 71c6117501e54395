"""Reading of mesh files (STL, OBJ, MSH, VTU) as triangles or tetrahedra; all but OBJ by meshio.

Wavefront OBJ files: points and faces; texture, normals and materials are passed over.
"""

import io
import warnings
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from identification.words import (
    MAX_INPUT_MAGNITUDE,
    InputError,
    Integers,
    Real,
    frozen_array,
)
from identification.words.file_access import check_file

_MESHIO_FORMATS = {".stl": "stl", ".msh": "gmsh", ".vtu": "vtu"}
_OBJ_SUFFIX = ".obj"
# First words of a gmsh file.
_GMSH_STARTS = (b"$MeshFormat", b"$Comments")
_FACE_KINDS = ("triangle", "quad", "polygon")
# Faces of each kind of cell, counter-clockwise from outside, in the numbering of VTK and gmsh.
_SIDES_OF_CELL: dict[str, tuple[tuple[int, ...], ...]] = {
    "hexahedron": (
        *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
        *((1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}


_CORNERS_OF_CELL = {
    **{"triangle": 3, "quad": 4, "tetra": 4},
    **{kind: 1 + max(map(max, sides)) for kind, sides in _SIDES_OF_CELL.items()},
}


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh of one kind: tetrahedra if there are any, otherwise triangles.

    Args:
        points: [m]; (n, 3).
        triangles: numbers of the corners, counter-clockwise seen from outside; (m, 3).
        tetrahedra: numbers of the corners; (k, 4).

    Raises:
        ValueError: a cell names a point that does not exist.
    """

    points: Real
    triangles: Integers
    tetrahedra: Integers

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(
            self, "points", frozen_array(self.points, np.float64, (None, 3), "points")
        )
        for name, corners in (("triangles", 3), ("tetrahedra", 4)):
            cells = frozen_array(getattr(self, name), np.intp, (None, corners), name)
            if cells.size and not 0 <= cells.min() <= cells.max() < len(self.points):
                raise ValueError(f"{name} name a point that does not exist")
            object.__setattr__(self, name, cells)


def read_mesh(path: Path, *, scale: float = 1.0) -> Mesh:
    """Read the mesh of a body.

    Quadrilaterals and polygons are divided about their middle, cells with five to eight corners
    about theirs. So neighbours agree on their common face even if it is not plane.

    Args:
        path: an STL (ASCII or binary), OBJ, MSH (gmsh) or VTU file.
        scale: metres per unit of the file.

    Raises:
        InputError: no such file, another format, an unreadable file, or other kinds of cells.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(
            f"{path}: scale is {scale:g}: give metres per unit of the file, above zero"
        )
    values, blocks = _read(path)
    if not sum(len(data) for _, data in blocks):
        raise InputError(
            f"{path}: the mesh has no faces and no cells: export a surface or a volume mesh"
        )
    points = _points(path, values, scale)
    for kind, data in blocks:
        if kind not in (*_FACE_KINDS, "tetra", *_SIDES_OF_CELL):
            raise InputError(
                f"{path}: the mesh has cells of kind {kind}, which are not handled: export "
                "triangles or tetrahedra with straight edges"
            )
        corners = _CORNERS_OF_CELL.get(kind, data.shape[-1])
        if data.shape[1:] != (corners,) or not 0 <= data.min() <= data.max() < len(points):
            raise InputError(
                f"{path}: a {kind} has other than {corners} corners, or names a point that "
                "does not exist: export the mesh again"
            )
    return _flat_mesh(points, blocks)


def is_gmsh(path: Path) -> bool:
    """Return whether a file is gmsh's; MuJoCo has its own binary format with this suffix."""
    with path.open("rb") as file:
        return file.read(16).startswith(_GMSH_STARTS)


def is_ascii_stl(path: Path) -> bool:
    """Return whether an STL file is text: its length does not fit a binary header's count."""
    with path.open("rb") as file:
        head = file.read(84)
    count = int.from_bytes(head[80:84], "little")
    return head.startswith(b"solid") and path.stat().st_size != 84 + 50 * count


def _read(path: Path) -> tuple[object, list[tuple[str, Integers]]]:
    """Return the points of a file, and its cells of the highest dimension by kind.

    meshio prints its errors and ends the program instead of raising.
    """
    if path.suffix.lower() not in (*_MESHIO_FORMATS, _OBJ_SUFFIX):
        raise InputError(
            f"{path}: this kind of file is not read as a mesh: give .stl, .obj, .msh or .vtu"
        )
    check_file(path, "give the path of a mesh file")
    printed = io.StringIO()
    try:
        if path.suffix.lower() == _OBJ_SUFFIX:
            return read_obj(path)
        with warnings.catch_warnings(), redirect_stdout(printed), redirect_stderr(printed):
            warnings.simplefilter("ignore")
            mesh = meshio.read(path, file_format=_MESHIO_FORMATS[path.suffix.lower()])
        dimension = max((block.dim for block in mesh.cells if len(block.data)), default=0)
        cells = [(b.type, np.asarray(b.data)) for b in mesh.cells if b.dim == dimension]
        return mesh.points, [(k, data) for k, data in cells if len(data) and dimension > 1]
    except (SystemExit, Exception) as error:
        # Readers fail on broken files in whatever way Python does: IndexError, struct.error.
        reason = str(error) if isinstance(error, OSError | meshio.ReadError | ValueError) else ""
        text = f" ({' '.join(reason.split())})" if reason else ""
        raise InputError(
            f"{path}: cannot be read as {path.suffix[1:].upper()}{text}: export the mesh again"
        ) from error


def _points(path: Path, values: object, scale: float) -> Real:
    """Return the points in metres; (n, 3)."""
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{path}: the points do not have three coordinates: export the mesh in 3D")
    is_number = (np.abs(points) <= MAX_INPUT_MAGNITUDE).all(axis=1)  # false for NaN
    if not is_number.all():
        raise InputError(
            f"{path}: the coordinates of point {int(np.argmin(is_number))} are not finite: export "
            "the mesh again"
        )
    return points * scale


def _flat_mesh(points: Real, blocks: Sequence[tuple[str, Integers]]) -> Mesh:
    """Return a mesh of triangles and tetrahedra made of cells of all kinds."""
    builder = _Builder([points], len(points))
    triangles, tetrahedra = [], []
    for kind, data in blocks:
        cells = data.astype(np.intp)
        if kind == "tetra":
            tetrahedra.append(cells)
        elif kind in _FACE_KINDS:
            triangles.append(builder.divide(cells))
        else:
            tetrahedra.append(builder.divide_solids(kind, cells))
    return Mesh(
        np.concatenate(builder.points),
        builder.merge_middles(np.concatenate([np.empty((0, 3), np.intp), *triangles])),
        builder.merge_middles(np.concatenate([np.empty((0, 4), np.intp), *tetrahedra])),
    )


@dataclass
class _Builder:
    """Points while cells are divided: those of the file, then the middles of divided cells.

    Args:
        points: blocks of points [m]; (n, 3) each.
        count: number of points so far.
    """

    points: list[Real]
    count: int

    def divide(self, faces: Integers) -> Integers:
        """Return the triangles of polygons, each polygon divided about its middle; (m, 3)."""
        if faces.shape[1] == 3:
            return faces
        middle = np.broadcast_to(self._middles(faces)[:, None], faces.shape)
        fan = np.stack([faces, np.roll(faces, -1, axis=1), middle], axis=2)
        return fan.reshape(-1, 3)

    def divide_solids(self, kind: str, cells: Integers) -> Integers:
        """Return the tetrahedra of cells, each cell divided about its middle; (k, 4).

        Each triangle of a cell's sides gives one tetrahedron.
        """
        top = self._middles(cells)
        parts = []
        for side in _SIDES_OF_CELL[kind]:
            triangles = self.divide(cells[:, side])
            apex = np.repeat(top, len(triangles) // len(cells))
            # A side runs counter-clockwise seen from outside; turned, it sees the apex.
            parts.append(np.column_stack([triangles[:, ::-1], apex]))
        return np.concatenate(parts)

    def merge_middles(self, cells: Integers) -> Integers:
        """Return the cells with one number for the middle of a face that two neighbours share."""
        count = len(self.points[0])
        if self.count == count:
            return cells
        _, first, which = np.unique(
            np.concatenate(self.points[1:]), axis=0, return_index=True, return_inverse=True
        )
        numbers: Integers = np.r_[np.arange(count), count + first[which.ravel()]]
        return numbers[cells]

    def _middles(self, cells: Integers) -> Integers:
        """Append the middles of cells and return their numbers."""
        # Corners in one order, so that both neighbours of a face round alike.
        new = self.points[0][np.sort(cells, axis=1)].mean(axis=1)
        self.points.append(new)
        self.count += len(new)
        return np.arange(self.count - len(new), self.count)


_MIN_CORNERS = 3  # of a face


def read_obj(path: Path) -> tuple[Real, list[tuple[str, Integers]]]:
    """Read points and faces of an OBJ file.

    A corner ``4/1/2`` names point 4, texture point 1 and normal 2; points count from 1, or from the
    last one backwards if negative. A file may have more texture points than points.

    Returns:
        Points (n, 3) in units of the file, and faces by the number of their corners: the kind of
        cell, and the corners from 0; (m, n_corner) each.

    Raises:
        ValueError: a line is malformed, or names a point that does not exist.
    """
    points: list[list[float]] = []
    faces: dict[int, list[list[int]]] = {}
    text = path.read_bytes().decode("utf-8", "replace").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), start=1):
        keyword, *fields = line.partition("#")[0].split() or [""]
        try:
            if keyword == "v":
                x, y, z, *_ = map(float, fields)
                points.append([x, y, z])
            elif keyword == "f":
                corners = [_number(field, len(points)) for field in fields]
                if len(corners) < _MIN_CORNERS:
                    raise ValueError(f"{len(corners)} corners")
                faces.setdefault(len(corners), []).append(corners)
        except ValueError as error:
            raise ValueError(
                f"line {number} is no point of three coordinates, and no face"
            ) from error
    kinds = {3: "triangle", 4: "quad"}
    blocks = [(kinds.get(n, "polygon"), np.array(rows, np.intp)) for n, rows in faces.items()]
    return np.array(points).reshape(-1, 3), blocks


def _number(field: str, count: int) -> int:
    """Return the number of a corner's point, from 0."""
    number = int(field.partition("/")[0])
    index = number - 1 if number > 0 else count + number
    if number == 0 or index < 0:
        raise ValueError(f"point {number} does not exist")
    return index
