"""Finite-element shapes from files: any mesh that meshio reads, with one shape per point data.

Frequencies come from a table beside the mesh, or from the names of the point data:
``mode 7 (34.51 Hz)``, ``f=34.51``, or ``DEPL[6] - 34.51``. The last is how MED files name steps by
their value; steps of an XDMF series are given such names. The number of a mode is that of its name.

Mode shapes of a finite-element model on its mesh.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.shapes.fe_fields import ShapeField, choose_shapes
from identification.shapes.fe_mesh import FeMesh, read_fe_mesh
from identification.words import MAX_INPUT_MAGNITUDE, InputError, Integers, Mask, Real
from identification.words.file_access import read_text


@dataclass(frozen=True, eq=False)
class Shapes:
    """Modes on a mesh.

    Args:
        source: file that they were read from.
        points: (n_point, 3) [m].
        triangles: faces as corners, for places between points and for pictures; (n_triangle, 3).
        frequencies: rising; (n_mode,) [Hz].
        vectors: displacements, in any normalisation that is common to all modes; (n_mode, n_point,
            3).
        remarks: sentences on what was left out of the file.
        stated_numbers: numbers of the modes in the file; empty if it states none.
    """

    source: str
    points: Real
    triangles: Integers
    frequencies: Real
    vectors: Real
    remarks: tuple[str, ...] = ()
    stated_numbers: tuple[int, ...] = ()

    def __len__(self) -> int:
        """Return the number of modes."""
        return len(self.frequencies)

    @property
    def numbers(self) -> Integers:
        """Numbers of the modes: those in the file, else from 1 in the order of frequencies."""
        return np.array(self.stated_numbers or np.arange(1, len(self) + 1), np.intp)

    @property
    def extent(self) -> float:
        """Diagonal of the box around the mesh [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def select(self, modes: Integers | Mask) -> "Shapes":
        """Return some of the modes."""
        return Shapes(
            self.source,
            self.points,
            self.triangles,
            self.frequencies[modes],
            self.vectors[modes],
            self.remarks,
            tuple(self.numbers[modes].tolist()),
        )


_HERTZ_PATTERN = re.compile(r"\bHz\b", re.IGNORECASE)
Face = tuple[int, ...]
# Triangles of a face by its number of points; quadratic faces are split at their mid-side points.
_TRIANGLES_OF_FACE: dict[int, tuple[Face, ...]] = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2), (0, 2, 3)),
    6: ((0, 3, 5), (3, 1, 4), (4, 2, 5), (3, 4, 5)),
    8: ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)),
}
# Fall between successive frequencies, relative to the highest: rigid modes come in any order.
_MAX_FREQUENCY_FALL = 1e-3
# Points of a shell element that its faces use; the centre of nine is left out.
_CORNERS_OF_SHELL = {"triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 8}
_TETRA_FACES: tuple[Face, ...] = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_BOX_FACES: tuple[Face, ...] = (
    (0, 3, 2, 1),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
)
_WEDGE_FACES: tuple[Face, ...] = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
# Faces of volume elements by their corners; mid-side points are left out.
_FACES_OF_VOLUME = {"tetra": _TETRA_FACES, "hexahedron": _BOX_FACES, "wedge": _WEDGE_FACES}


def read_shapes(path: Path, frequencies: Path | None = None) -> Shapes:
    """Read modes from a mesh file.

    Args:
        path: VTU, MED, XDMF or another format of meshio; in metres.
        frequencies: text file with a frequency [Hz] in each row, with or without the mode's number
            before it, in the order of the shapes; None to read them from the names of the point
            data.

    Returns:
        The modes, by rising frequency.

    Raises:
        InputError: no such file, no shapes, or frequencies that do not fit them.
    """
    mesh = read_fe_mesh(path)
    data = mesh.data
    names = sorted((name for name, array in data.items() if _is_shape(array)), key=_natural_order)
    if not names:
        raise InputError(
            f"{path} has no shapes: each must be point data of three components (it has "
            f"{', '.join(sorted(data)) or 'none'}). Write the displacements of modes as vectors."
        )
    shapes, remarks = choose_shapes(path.name, {name: data[name] for name in names})
    fields = sorted(shapes, key=lambda field: names.index(field.name))
    names = [field.name for field in fields]
    if frequencies is None:
        fields, unnamed = _with_frequencies(path, fields)
        remarks += unnamed
        values = np.array([field.frequency for field in fields], float)
    else:
        values = _read_frequency_table(frequencies)
        if len(values) != len(names):
            raise InputError(
                f"{frequencies} has {len(values)} frequencies for the {len(names)} shapes of "
                f"{path} ({names[0]} .. {names[-1]}). Give one a row, in their order."
            )
    vectors = np.array([field.values for field in fields])
    is_number = np.abs(vectors) <= MAX_INPUT_MAGNITUDE  # false for NaN
    if not is_number.all():
        bad = fields[int(np.flatnonzero(~is_number.all(axis=(1, 2)))[0])].name
        raise InputError(f"{path}: {bad} holds values that are no numbers. Write the mode again.")
    _check_frequencies(str(frequencies or path), values)
    order = np.argsort(values, kind="stable")
    try:
        triangles = _triangles(path, mesh)
    except IndexError as error:
        raise InputError(f"{path}: a cell has too few corners. Write the mesh again.") from error
    numbers = [field.number for field in fields]
    has_numbers = None not in numbers and len(set(numbers)) == len(numbers)
    return Shapes(
        str(path),
        mesh.points,
        triangles,
        values[order],
        vectors[order],
        (*mesh.remarks, *remarks),
        tuple(numbers[k] for k in order) if has_numbers else (),
    )


def _is_shape(values: Real) -> bool:
    """Return whether point data have three displacements a point, or these and three rotations."""
    return values.ndim == 2 and values.shape[1] in (3, 6)


def _natural_order(name: str) -> tuple[tuple[int, float, str], ...]:
    """Return a sort key that puts mode 10 after mode 9."""
    parts = re.split(r"(\d+(?:\.\d+)?)", name)
    return tuple((1, float(part), "") if k % 2 else (0, 0.0, part) for k, part in enumerate(parts))


def _with_frequencies(
    path: Path, fields: list[ShapeField]
) -> tuple[list[ShapeField], tuple[str, ...]]:
    """Return the shapes whose names hold a frequency, and a remark on the others."""
    named = [field for field in fields if field.frequency is not None]
    unnamed = [field.name for field in fields if field.frequency is None]
    for name in unnamed:
        if _HERTZ_PATTERN.search(name):
            raise InputError(
                f"{path}: the name {name!r} holds no frequency. Write it as 'mode 1 (34.5 Hz)', "
                "with a point."
            )
    if not named:
        raise InputError(
            f"{path}: the point data ({', '.join(unnamed[:3])} ..) name no frequencies. Name them "
            "as 'mode 1 (34.5 Hz)', or give a file with --frequencies."
        )
    if not unnamed:
        return named, ()
    more = f" and {len(unnamed) - 1} more" if len(unnamed) > 1 else ""
    return named, (f"{path.name}: {unnamed[0]}{more}: without a frequency, left out",)


def _read_frequency_table(path: Path) -> Real:
    """Read a frequency from each row, alone or after the mode's number.

    Rows without a number and # comments are skipped.
    """
    text = read_text(path, "give a file with a frequency in each row")
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        text_cells = line.partition("#")[0]
        cells = [cell for cell in re.split(r"[\s;]+|,\s*", text_cells) if cell]
        numbers = [value for cell in cells if (value := _parse_number(cell)) is not None]
        has_mode_number = len(numbers) == 2 and numbers[0] % 1 == 0
        if has_mode_number and rows and "," in text_cells:  # or decimals have a comma
            has_mode_number = numbers[0] == rows[-1][0] + 1
        if (len(numbers) > 1 and not has_mode_number) or (
            not numbers and any(map(str.isdigit, text_cells))
        ):
            raise InputError(
                f"{path}: row {number}, {line.strip()!r}, is not a frequency, nor a mode's number "
                "and its frequency. Write decimals with a point, and nothing else in a row."
            )
        rows += [numbers] if numbers else []
    values = np.array([row[-1] for row in rows])
    falls = np.flatnonzero(np.diff(values) < -_MAX_FREQUENCY_FALL * np.abs(values).max(initial=0.0))
    if len(falls):
        raise InputError(
            f"{path}: frequencies fall from {values[falls[0]]:g} to {values[falls[0] + 1]:g} Hz, "
            "where modes rise. Give them in the order of the shapes, or name each shape's own: "
            "'mode 7 (34.5 Hz)'."
        )
    return values


def _parse_number(cell: str) -> float | None:
    """Return a number, or None if the text is none."""
    try:
        return float(cell)
    except ValueError:
        return None


def _check_frequencies(source: str, values: Real) -> None:
    """Refuse frequencies that cannot be those of modes."""
    is_number = np.abs(values) <= MAX_INPUT_MAGNITUDE  # false for NaN
    if not is_number.all():
        raise InputError(
            f"{source}: the frequency of shape {int(np.argmin(is_number)) + 1} is no "
            "number. Give one for each shape."
        )
    if len(values) > 2 and np.ptp(values) == 0:
        raise InputError(
            f"{source}: all {len(values)} frequencies are {values[0]:g} Hz. Give each its own."
        )


def _triangles(path: Path, mesh: FeMesh) -> Integers:
    """Return triangles of the outer faces of volumes and of all shells; (n, 3)."""
    triangles: list[Integers] = []
    sides: dict[int, list[Integers]] = {}
    for kind, data in mesh.cells:
        if kind in _CORNERS_OF_SHELL:
            triangles += _split_faces(data[:, : _CORNERS_OF_SHELL[kind]])
        if kind.rstrip("0123456789") == "line":
            triangles.append(data[:, [0, 1, 1]])  # a beam becomes a face without width
        for face in _FACES_OF_VOLUME.get(kind.rstrip("0123456789"), ()):
            sides.setdefault(len(face), []).append(data[:, face])
    for faces in sides.values():
        triangles += _split_faces(_outer_faces(np.concatenate(faces)))
    if not triangles:
        kinds = ", ".join(sorted({kind for kind, _ in mesh.cells})) or "no cells"
        raise InputError(f"{path} has no faces ({kinds}). Give beams, shells or volumes.")
    return np.concatenate(triangles)


def _split_faces(faces: Integers) -> list[Integers]:
    """Split faces into triangles."""
    return [faces[:, corners] for corners in _TRIANGLES_OF_FACE[faces.shape[1]]]


def _outer_faces(faces: Integers) -> Integers:
    """Return the faces that no other volume shares."""
    _, place, counts = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return np.asarray(faces[counts[np.ravel(place)] == 1], np.intp)
