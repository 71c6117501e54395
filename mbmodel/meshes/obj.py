"""Wavefront OBJ files: points and faces; texture, normals and materials are passed over."""

from pathlib import Path

import numpy as np

from identification.words import Integers, Real

_MIN_CORNERS = 3  # of a face


def read_obj(path: Path) -> tuple[Real, list[tuple[str, Integers]]]:
    """Read points and faces of an OBJ file.

    A corner ``4/1/2`` names point 4, texture point 1 and normal 2; points count from 1, or from the
    last one backwards if negative. A file may have more texture points than points.

    Args:
        path: the file.

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
