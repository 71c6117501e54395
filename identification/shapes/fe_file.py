"""Finite-element shapes from files: any mesh that meshio reads, a shape each in its point data.

Only here and in ``mbmodel.meshfile`` is meshio. Frequencies come from a table beside the mesh, or
from the names of the point data: ``mode 7 (34.51 Hz)``, ``f=34.51``, or ``DEPL[6] - 34.51`` as MED
files name steps by their value.
"""

import contextlib
import io
import re
from pathlib import Path

import meshio
import numpy as np

from identification.shapes.shapes import Shapes
from identification.words import InputError, Integers, Real

_NUMBER = r"([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)"
_NAMED = (
    re.compile(_NUMBER + r"\s*Hz\b", re.IGNORECASE),
    re.compile(r"\bf(?:req(?:uency)?)?\s*[=:]\s*" + _NUMBER, re.IGNORECASE),
    re.compile(r"\[\d+\]\s*-\s*" + _NUMBER + r"$"),
)
Face = tuple[int, ...]
# How faces of so many points are cut into triangles; quadratic ones at the middles of their sides.
_CUT: dict[int, tuple[Face, ...]] = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2), (0, 2, 3)),
    6: ((0, 3, 5), (3, 1, 4), (4, 2, 5), (3, 4, 5)),
    8: ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)),
}
_SHELLS = {"triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 8}
_TETRA: tuple[Face, ...] = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_BOX: tuple[Face, ...] = (
    (0, 3, 2, 1),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
)
_WEDGE: tuple[Face, ...] = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
# Faces of volumes by their corners, whatever lies between these.
_VOLUMES = {"tetra": _TETRA, "hexahedron": _BOX, "wedge": _WEDGE}


def read_shapes(path: Path, frequencies: Path | None = None) -> Shapes:
    """Read modes from a mesh file.

    Args:
        path: VTU, MED, XDMF and whatever else meshio reads; in metres.
        frequencies: a text file with a frequency [Hz] in each row, its last number, in the order
            of the shapes; None to find them in the names of the point data.

    Returns:
        The modes, by rising frequency.

    Raises:
        InputError: no such file, no shapes, frequencies that do not fit them.
    """
    mesh = _mesh(path)
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    data = {name: np.asarray(one, float) for name, one in mesh.point_data.items()}
    names = sorted((n for n, one in data.items() if _is_shape(one)), key=_natural)
    if not names:
        raise InputError(
            f"{path} has no shapes: each must be point data of three components (it has "
            f"{', '.join(sorted(data)) or 'none'}). Write displacements of modes as vectors."
        )
    if frequencies is None:
        values, names = _from_names(path, names)
    else:
        values = _table(frequencies)
        if len(values) != len(names):
            raise InputError(
                f"{frequencies} has {len(values)} frequencies for the {len(names)} shapes of "
                f"{path} ({names[0]} .. {names[-1]}). Give one a row, in their order."
            )
    vectors = np.array([data[name][:, :3] for name in names])
    if not np.isfinite(vectors).all():
        bad = names[int(np.flatnonzero(~np.isfinite(vectors).all(axis=(1, 2)))[0])]
        raise InputError(f"{path}: {bad} holds values that are no numbers. Write the mode again.")
    order = np.argsort(values, kind="stable")
    return Shapes(str(path), points, _triangles(path, mesh), values[order], vectors[order])


def _mesh(path: Path) -> meshio.Mesh:
    """Read through meshio, which prints what went wrong and ends the program."""
    if not path.is_file():
        raise InputError(f"{path} is not there. Give a mesh file with shapes as point data.")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return meshio.read(path)
    except (SystemExit, Exception) as error:
        reason = str(error) if isinstance(error, OSError | meshio.ReadError) else ""
        raise InputError(
            f"{path} cannot be read as a mesh{f' ({reason})' if reason else ''}. "
            "Give VTU, MED, XDMF or another format of meshio."
        ) from error


def _is_shape(values: Real) -> bool:
    """Three displacements a point, or these and three rotations."""
    return values.ndim == 2 and values.shape[1] in (3, 6)


def _natural(name: str) -> tuple[tuple[int, float, str], ...]:
    """Mode 10 after mode 9."""
    parts = re.split(r"(\d+(?:\.\d+)?)", name)
    return tuple((1, float(one), "") if k % 2 else (0, 0.0, one) for k, one in enumerate(parts))


def _from_names(path: Path, names: list[str]) -> tuple[Real, list[str]]:
    """Frequencies that are named, and the point data that name one."""
    found = {}
    for name in names:
        match = next((m for pattern in _NAMED if (m := pattern.search(name))), None)
        if match is not None:
            found[name] = float(match[1])
    if not found:
        raise InputError(
            f"{path}: the point data ({', '.join(names[:3])} ..) name no frequencies. Name them "
            "as 'mode 1 (34.5 Hz)', or give a file with --frequencies."
        )
    return np.array(list(found.values())), list(found)


def _table(path: Path) -> Real:
    """The last number of each row."""
    if not path.is_file():
        raise InputError(f"{path} is not there. Give a text file with a frequency in each row.")
    rows = [re.findall(_NUMBER, line) for line in path.read_text("utf-8").splitlines()]
    return np.array([float(row[-1]) for row in rows if row])


def _triangles(path: Path, mesh: meshio.Mesh) -> Integers:
    """Faces on the outside of volumes, and all of shells; (n, 3)."""
    found: list[Integers] = []
    sides: dict[int, list[Integers]] = {}
    for block in mesh.cells:
        data = np.asarray(block.data, np.intp)
        if block.type in _SHELLS:
            found += _cut(data[:, : _SHELLS[block.type]])
        for face in _VOLUMES.get(block.type.rstrip("0123456789"), ()):
            sides.setdefault(len(face), []).append(data[:, face])
    for faces in sides.values():
        found += _cut(_outside(np.concatenate(faces)))
    if not found:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "no cells"
        raise InputError(f"{path} has no faces ({kinds}). Give shells or volumes.")
    return np.concatenate(found)


def _cut(faces: Integers) -> list[Integers]:
    return [faces[:, part] for part in _CUT[faces.shape[1]]]


def _outside(faces: Integers) -> Integers:
    """Those that no other volume shares."""
    _, place, counts = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return np.asarray(faces[counts[np.ravel(place)] == 1], np.intp)
