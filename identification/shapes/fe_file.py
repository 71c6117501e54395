"""Finite-element shapes from files: any mesh that meshio reads, a shape each in its point data.

Only here and in ``mbmodel.meshfile`` is meshio. Frequencies come from a table beside the mesh, or
from the names of the point data: ``mode 7 (34.51 Hz)``, ``f=34.51``, or ``DEPL[6] - 34.51`` as MED
files name steps by their value; so are the steps of an XDMF series named.
"""

import contextlib
import io
import re
from pathlib import Path

import meshio
import numpy as np

from identification.shapes.fe_shapes import Shapes
from identification.words import InputError, Integers, Real

_NUMBER = r"(?<![\d.,])([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)"
_HERTZ = re.compile(r"\bHz\b", re.IGNORECASE)
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
_ROUNDING = 1e-3  # of the highest frequency: modes at rest come in any order
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
        frequencies: a text file with a frequency [Hz] in each row, the mode's number before it or
            not, in the order of the shapes; None to find them in the names of the point data.

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
    _check(str(frequencies or path), values)
    order = np.argsort(values, kind="stable")
    return Shapes(str(path), points, _triangles(path, mesh), values[order], vectors[order])


def _mesh(path: Path) -> meshio.Mesh:
    """Read through meshio, which prints what went wrong and ends the program."""
    if not path.is_file():
        raise InputError(f"{path} is not there. Give a mesh file with shapes as point data.")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return _steps(path) if _is_series(path) else meshio.read(path)
    except (SystemExit, Exception) as error:
        reason = str(error) if isinstance(error, OSError | meshio.ReadError) else ""
        raise InputError(
            f"{path} cannot be read as a mesh{f' ({reason})' if reason else ''}. "
            "Give VTU, MED, XDMF or another format of meshio."
        ) from error


def _is_series(path: Path) -> bool:
    """Whether an XDMF file holds steps, each at a value."""
    return path.suffix in {".xdmf", ".xmf"} and 'CollectionType="Temporal"' in path.read_text(
        "utf-8", errors="replace"
    )


def _steps(path: Path) -> meshio.Mesh:
    """The mesh of a series with the shape of each step, whose value is the mode's frequency."""
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, cells = reader.read_points_cells()
        shapes: dict[str, Real] = {}
        for step in range(reader.num_steps):
            value, data, _ = reader.read_data(step)
            for name, one in data.items():
                shapes[f"{name}[{step}] - {float(value)!r}"] = one
    return meshio.Mesh(points, cells, point_data=shapes)


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
        elif _HERTZ.search(name):
            raise InputError(
                f"{path}: the name {name!r} tells no frequency. Write it as 'mode 1 (34.5 Hz)', "
                "with a point."
            )
    if not found:
        raise InputError(
            f"{path}: the point data ({', '.join(names[:3])} ..) name no frequencies. Name them "
            "as 'mode 1 (34.5 Hz)', or give a file with --frequencies."
        )
    return np.array(list(found.values())), list(found)


def _table(path: Path) -> Real:
    """A frequency of each row, alone or after the mode's number; words and # comments are none."""
    try:
        text = path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} cannot be read as text. Give a file with a frequency in each row."
        ) from error
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        stated = line.partition("#")[0]
        cells = [cell for cell in re.split(r"[\s;]+|,\s*", stated) if cell]
        own = [value for cell in cells if (value := _number(cell)) is not None]
        numbered = len(own) == 2 and own[0] % 1 == 0
        if numbered and rows and "," in stated:  # or decimals have a comma
            numbered = own[0] == rows[-1][0] + 1
        if (len(own) > 1 and not numbered) or (not own and any(map(str.isdigit, stated))):
            raise InputError(
                f"{path}: row {number}, {line.strip()!r}, is not a frequency, nor a mode's number "
                "and its frequency. Write decimals with a point, and nothing else in a row."
            )
        rows += [own] if own else []
    values = np.array([row[-1] for row in rows])
    falls = np.flatnonzero(np.diff(values) < -_ROUNDING * np.abs(values).max(initial=0.0))
    if len(falls):
        raise InputError(
            f"{path}: frequencies fall from {values[falls[0]]:g} to {values[falls[0] + 1]:g} Hz, "
            "where modes rise. Give them in the order of the shapes, or name each shape's own: "
            "'mode 7 (34.5 Hz)'."
        )
    return values


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _check(source: str, values: Real) -> None:
    """Frequencies that can be those of modes."""
    if not np.isfinite(values).all():
        raise InputError(
            f"{source}: the frequency of shape {int(np.argmin(np.isfinite(values))) + 1} is no "
            "number. Give one for each shape."
        )
    if len(values) > 2 and np.ptp(values) == 0:
        raise InputError(
            f"{source}: all {len(values)} frequencies are {values[0]:g} Hz. Give each its own."
        )


def _triangles(path: Path, mesh: meshio.Mesh) -> Integers:
    """Faces on the outside of volumes, and all of shells; (n, 3)."""
    found: list[Integers] = []
    sides: dict[int, list[Integers]] = {}
    for block in mesh.cells:
        data = np.asarray(block.data, np.intp)
        if block.type in _SHELLS:
            found += _cut(data[:, : _SHELLS[block.type]])
        if block.type.rstrip("0123456789") == "line":
            found.append(data[:, [0, 1, 1]])  # a beam: a face without width
        for face in _VOLUMES.get(block.type.rstrip("0123456789"), ()):
            sides.setdefault(len(face), []).append(data[:, face])
    for faces in sides.values():
        found += _cut(_outside(np.concatenate(faces)))
    if not found:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "no cells"
        raise InputError(f"{path} has no faces ({kinds}). Give beams, shells or volumes.")
    return np.concatenate(found)


def _cut(faces: Integers) -> list[Integers]:
    return [faces[:, part] for part in _CUT[faces.shape[1]]]


def _outside(faces: Integers) -> Integers:
    """Those that no other volume shares."""
    _, place, counts = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return np.asarray(faces[counts[np.ravel(place)] == 1], np.intp)
