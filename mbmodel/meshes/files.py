"""Meshes from files: STL, OBJ, MSH and VTU, as triangles or tetrahedra. Only here is meshio."""

import io
import warnings
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from identification.words import InputError, Integers, Real, frozen

_FORMATS = {".stl": "stl", ".obj": "obj", ".msh": "gmsh", ".vtu": "vtu"}
_GMSH_STARTS = (b"$MeshFormat", b"$Comments")
_FACES = ("triangle", "quad", "polygon")
# Faces of the cells, seen from outside, in the numbering of VTK and gmsh.
_SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "hexahedron": (
        *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
        *((1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh of one kind: tetrahedra if there are any, else triangles.

    Args:
        points: [m]; (n, 3).
        triangles: corners, counter-clockwise seen from outside; (m, 3).
        tetrahedra: corners; (k, 4).
    """

    points: Real
    triangles: Integers
    tetrahedra: Integers

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, "points", frozen(self.points, np.float64, (None, 3), "points"))
        for name, corners in (("triangles", 3), ("tetrahedra", 4)):
            cells = frozen(getattr(self, name), np.intp, (None, corners), name)
            if cells.size and not 0 <= cells.min() <= cells.max() < len(self.points):
                raise ValueError(f"{name} name a point that is not there")
            object.__setattr__(self, name, cells)


def read_mesh(path: Path, *, scale: float = 1.0) -> Mesh:
    """Read the mesh of a body.

    Quadrilaterals and polygons are divided about their own middle, cells with six or eight corners
    about theirs, so that neighbours agree on their common face even if it is not plane.

    Args:
        path: an STL (ASCII or binary), OBJ, MSH (gmsh) or VTU file.
        scale: metres per unit of the file.

    Raises:
        InputError: no such file, another format, not readable, cells of another kind.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"{path}: scale {scale:g}: give metres per unit of the file, above zero")
    found = _read(path)
    dimension = max((block.dim for block in found.cells if len(block.data)), default=0)
    blocks = [(b.type, np.asarray(b.data)) for b in found.cells if b.dim == dimension]
    if dimension < 2 or not sum(len(data) for _, data in blocks):
        raise InputError(f"{path}: has no faces and no cells: export a surface or a volume mesh")
    points = _points(path, found.points, scale)
    for kind, data in blocks:
        if kind not in (*_FACES, "tetra", *_SIDES):
            raise InputError(
                f"{path}: has cells of kind {kind}, which are not handled: export triangles or "
                "tetrahedra with straight edges"
            )
        if data.size and not 0 <= data.min() <= data.max() < len(points):
            raise InputError(f"{path}: a {kind} names a point that is not there: export it again")
    return _flat_mesh(points, blocks)


def is_gmsh(path: Path) -> bool:
    """Whether a file is gmsh's; MuJoCo has a binary format of its own under the same suffix."""
    with path.open("rb") as file:
        return file.read(16).startswith(_GMSH_STARTS)


def is_ascii_stl(path: Path) -> bool:
    """Whether an STL file is text: its length is not what a binary header's count asks for."""
    with path.open("rb") as file:
        head = file.read(84)
    count = int.from_bytes(head[80:84], "little")
    return head.startswith(b"solid") and path.stat().st_size != 84 + 50 * count


def _read(path: Path) -> meshio.Mesh:
    """Read through meshio, which prints what went wrong and ends the program."""
    if path.suffix.lower() not in _FORMATS:
        raise InputError(f"{path}: is no mesh that is read here: give .stl, .obj, .msh or .vtu")
    if not path.is_file():
        raise InputError(f"{path} does not exist: name a mesh file")
    said = io.StringIO()
    try:
        with warnings.catch_warnings(), redirect_stdout(said), redirect_stderr(said):
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=_FORMATS[path.suffix.lower()])
    except (SystemExit, Exception) as error:
        # Readers fail on broken files in whatever way Python does: IndexError, struct.error.
        reason = str(error) if isinstance(error, OSError | meshio.ReadError) else ""
        text = f" ({' '.join(reason.split())})" if reason else ""
        raise InputError(
            f"{path}: cannot be read as {path.suffix[1:].upper()}{text}: export it again"
        ) from error


def _points(path: Path, values: object, scale: float) -> Real:
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{path}: its points have no three coordinates: export it in space")
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError(f"{path}: point {row} is no finite number: export it again")
    return points * scale


def _flat_mesh(points: Real, blocks: Sequence[tuple[str, Integers]]) -> Mesh:
    builder = _Builder([points], len(points))
    triangles, tetrahedra = [], []
    for kind, data in blocks:
        cells = data.astype(np.intp)
        if kind == "tetra":
            tetrahedra.append(cells)
        elif kind in _FACES:
            triangles.append(builder.divide(cells))
        else:
            tetrahedra.append(builder.divide_solids(kind, cells))
    return Mesh(
        np.concatenate(builder.points),
        builder.one_number(np.concatenate([np.empty((0, 3), np.intp), *triangles])),
        builder.one_number(np.concatenate([np.empty((0, 4), np.intp), *tetrahedra])),
    )


@dataclass
class _Builder:
    """Points so far: the file's own, then the middles of divided cells."""

    points: list[Real]
    count: int

    def divide(self, faces: Integers) -> Integers:
        """Triangles of polygons, each about its middle; of a triangle itself."""
        if faces.shape[1] == 3:
            return faces
        middle = np.broadcast_to(self._middles(faces)[:, None], faces.shape)
        fan = np.stack([faces, np.roll(faces, -1, axis=1), middle], axis=2)
        return fan.reshape(-1, 3)

    def divide_solids(self, kind: str, cells: Integers) -> Integers:
        """Tetrahedra of cells, each about its middle: one for each triangle of its sides."""
        top = self._middles(cells)
        parts = []
        for side in _SIDES[kind]:
            triangles = self.divide(cells[:, side])
            apex = np.repeat(top, len(triangles) // len(cells))
            # A side runs counter-clockwise seen from outside; turned, it sees the apex.
            parts.append(np.column_stack([triangles[:, ::-1], apex]))
        return np.concatenate(parts)

    def one_number(self, cells: Integers) -> Integers:
        """The same cells with one number for the middle that two neighbours gave a face."""
        own = len(self.points[0])
        if self.count == own:
            return cells
        _, first, which = np.unique(
            np.concatenate(self.points[1:]), axis=0, return_index=True, return_inverse=True
        )
        numbers: Integers = np.r_[np.arange(own), own + first[which.ravel()]]
        return numbers[cells]

    def _middles(self, cells: Integers) -> Integers:
        # Corners in one order, so that both neighbours of a face round alike.
        new = self.points[0][np.sort(cells, axis=1)].mean(axis=1)
        self.points.append(new)
        self.count += len(new)
        return np.arange(self.count - len(new), self.count)
