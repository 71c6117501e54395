"""Coordinate systems of universal files: datasets 2420 and 18, resolved to world axes.

A node names two of them. Its coordinates are given in the definition system; its motion and forces
are measured along the axes that the displacement system has at the node.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.readers.uff_blocks import Block, parse_number, parse_numbers
from identification.words import MAX_INPUT_MAGNITUDE, Real

CARTESIAN, CYLINDRICAL, SPHERICAL = 0, 1, 2
KIND_NAMES = {CYLINDRICAL: "cylindrical", SPHERICAL: "spherical"}
WORLD_LABELS = (0, 1)  # of world axes, unless the file defines them otherwise
_HEAD_LINES_2420 = 2  # number and name of the part
_LINES_OF_MATRIX = 4  # three axes and the origin
_POINT_NUMBERS = 9  # origin, a point on +x, a point in the plane of +x and +z
_MAX_FRAME_ERROR = 1e-3  # of unit axes at right angles: four digits of a matrix typed by hand
_MIN_RADIUS = 1e-9  # of the distance from the origin: closer to the axis, azimuth is rounding
_MAX_TURN = 1e-5  # of the entries of axes: six digits of E13.5


@dataclass(frozen=True, eq=False)
class CoordinateSystem:
    """A Cartesian, cylindrical or spherical system.

    Coordinates are x y z; r [m], azimuth [degrees], z; or r [m], polar angle from z [degrees],
    azimuth [degrees].

    Args:
        kind: 0, 1 or 2, in the order above.
        origin: origin in world axes [m]; (3,).
        axes: Cartesian axes of the system as columns, in world axes; (3, 3).
    """

    kind: int
    origin: Real
    axes: Real

    def position(self, coordinates: Real, length: float) -> Real:
        """Return the position of a point in world axes [m]; (3,).

        Args:
            coordinates: coordinates in this system; lengths in the unit of the file.
            length: unit factor of length, by which lengths are divided.
        """
        first, second, third = coordinates
        radius, angle = first / length, np.radians(second)
        if self.kind == CYLINDRICAL:
            local = np.array([radius * np.cos(angle), radius * np.sin(angle), third / length])
        elif self.kind == SPHERICAL:
            azimuth = np.radians(third)
            across = radius * np.sin(angle)
            local = np.array(
                [across * np.cos(azimuth), across * np.sin(azimuth), radius * np.cos(angle)]
            )
        else:
            local = coordinates / length
        return self.origin + self.axes @ local

    def axes_at(self, position: Real) -> Real:
        """Return the directions in which the coordinates of a point grow, as columns; (3, 3).

        On the axis of the system, where the radial direction is not determined, azimuth 0 counts.

        Args:
            position: the point, in world axes [m]; (3,).
        """
        x, y, z = self.axes.T @ (position - self.origin)
        radius, distance = np.hypot(x, y), float(np.linalg.norm([x, y, z]))
        if self.kind == CARTESIAN or not distance:
            return self.axes
        is_on_axis = radius <= _MIN_RADIUS * distance
        cosine, sine = (1.0, 0.0) if is_on_axis else (x / radius, y / radius)
        azimuthal = np.array([-sine, cosine, 0.0])
        if self.kind == CYLINDRICAL:
            frame = [np.array([cosine, sine, 0.0]), azimuthal, np.array([0.0, 0.0, 1.0])]
        else:
            radial = np.array([cosine * radius, sine * radius, z]) / distance
            frame = [radial, np.cross(azimuthal, radial), azimuthal]
        return self.axes @ np.column_stack(frame)


WORLD = CoordinateSystem(CARTESIAN, np.zeros(3), np.eye(3))


def is_turned(axes: Real) -> bool:
    """Return whether axes, as columns, differ from those of the world."""
    return not np.allclose(axes, np.eye(3), atol=_MAX_TURN)


def read_systems_2420(block: Block) -> dict[str, Any]:
    """Return labels, kinds and matrices (axes and origin as rows) of a dataset 2420.

    Raises:
        ValueError: a number is malformed or missing.
    """
    lines = "\n".join(block.lines()[_HEAD_LINES_2420:]).rstrip().split("\n")
    labels, kinds, matrices = [], [], []
    step = 2 + _LINES_OF_MATRIX  # label, name (which may be blank) and matrix
    for start in range(0, len(lines), step):
        label, kind, *_ = map(int, lines[start].split())
        matrix = parse_numbers(lines[start + 2 : start + step])
        labels.append(label)
        kinds.append(kind)
        matrices.append(_refuse_extreme(matrix.reshape(_LINES_OF_MATRIX, 3)))
    return {"type": block.kind, "labels": labels, "kinds": kinds, "matrices": matrices}


def read_systems_18(block: Block) -> dict[str, Any]:
    """Return labels, kinds, reference systems and three points of each system of a dataset 18.

    Raises:
        ValueError: a number is malformed or missing.
        IndexError: lines are missing.
    """
    lines = "\n".join(block.lines()).rstrip().split("\n")
    record: dict[str, Any] = {"type": block.kind}
    record |= {key: [] for key in ("labels", "kinds", "references", "points")}
    position = 0
    while position < len(lines):
        label, kind, reference, *_ = map(int, lines[position].split())
        position += 2  # the second line is a name, which may be blank
        numbers: list[float] = []
        while len(numbers) < _POINT_NUMBERS:
            numbers += map(parse_number, lines[position].split())
            position += 1
        record["labels"].append(label)
        record["kinds"].append(kind)
        record["references"].append(reference)
        record["points"].append(_refuse_extreme(np.array(numbers).reshape(3, 3)))
    return record


def _refuse_extreme(numbers: Real) -> Real:
    """Return numbers that are those of a place or an axis.

    Raises:
        ValueError: a number is NaN, or larger than any of a machine.
    """
    if not (np.abs(numbers) <= MAX_INPUT_MAGNITUDE).all():
        raise ValueError("a coordinate system holds NaN or absurd numbers")
    return numbers


def resolve_systems(
    records: Sequence[tuple[dict[str, Any], float]],
) -> dict[int, CoordinateSystem]:
    """Return the coordinate systems by label, in world axes.

    Systems that are no frame are left out: axes that are not at right angles, points on one line,
    an unknown kind, or a reference system that does not exist.

    Args:
        records: content of datasets 2420 and 18, each with the unit factor of length.
    """
    systems: dict[int, CoordinateSystem] = {}
    pending: dict[int, tuple[int, int, Real, float]] = {}
    for record, length in records:
        if "matrices" in record:
            for label, kind, matrix in zip(
                record["labels"], record["kinds"], record["matrices"], strict=True
            ):
                _add_frame(systems, label, kind, matrix[:3].T, matrix[3] / length)
        else:
            columns = (record[key] for key in ("labels", "kinds", "references", "points"))
            for label, kind, reference, points in zip(*columns, strict=True):
                pending[label] = (kind, reference, points, length)
    while ready := [label for label, system in pending.items() if system[1] not in pending]:
        for label in ready:
            kind, reference, points, length = pending.pop(label)
            basis = systems.get(reference, WORLD if reference in WORLD_LABELS else None)
            if basis is not None:
                origin, on_x, on_xz = (basis.position(point, length) for point in points)
                _add_frame(systems, label, kind, _axes_of_points(origin, on_x, on_xz), origin)
    return systems


def _axes_of_points(origin: Real, on_x: Real, on_xz: Real) -> Real:
    """Return the axes, as columns, of a system that three points define; NaN on one line."""
    x, across = on_x - origin, np.cross(on_xz - origin, on_x - origin)
    with np.errstate(invalid="ignore"):
        x, y = x / np.linalg.norm(x), across / np.linalg.norm(across)
    return np.column_stack([x, y, np.cross(x, y)])


def _add_frame(
    systems: dict[int, CoordinateSystem], label: int, kind: int, axes: Real, origin: Real
) -> None:
    """Add a system with the nearest axes at right angles, if its axes are a frame."""
    if kind not in (CARTESIAN, *KIND_NAMES) or not np.isfinite([*axes, origin]).all():
        return
    left, stretch, right = np.linalg.svd(axes)
    if np.abs(stretch - 1.0).max() <= _MAX_FRAME_ERROR:
        systems[label] = CoordinateSystem(kind, origin, left @ right)
