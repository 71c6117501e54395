"""Shapes at sensors: the nearest point of the mesh, or between the corners of the nearest face."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from identification.shapes.fe_shapes import Shapes
from identification.words import InputError, Integers, Real

How = Literal["interpolated", "nearest"]
_SEVERAL = 3  # sensors, of which not all lie in one spot
_FAR = 0.02  # of the mesh's extent: a sensor's own height, a panel's thickness


def shapes_at(
    shapes: Shapes,
    positions: Real,
    names: Sequence[str],
    *,
    how: How = "interpolated",
    far: float | None = None,
) -> Real:
    """Displacements of all modes at some places.

    Args:
        shapes: modes on a mesh.
        positions: of the places [m]; (n, 3).
        names: of the places, for messages; n.
        how: ``interpolated`` on the nearest face, linear between its corners, or those of the
            ``nearest`` point.
        far: how far from the mesh a place may be [m]; 2 % of the mesh's diagonal if None.

    Returns:
        In world axes; (n_mode, n, 3).

    Raises:
        InputError: a place off the mesh, by name, with the distance; places in other units.
    """
    if how == "nearest":
        apart = np.linalg.norm(shapes.points[None] - positions[:, None], axis=2)
        corners, weights = apart.argmin(axis=1)[:, None], np.ones((len(positions), 1))
        distances = apart.min(axis=1)
    else:
        corners, weights, distances = _nearest(shapes, positions)
    limit = _FAR * shapes.extent if far is None else far
    _check_units(shapes, positions)
    off = np.flatnonzero(~(distances <= limit))
    if len(off):
        worst = int(off[distances[off].argmax()])
        low, high = shapes.points.min(axis=0), shapes.points.max(axis=0)
        raise InputError(
            f"{names[worst]} at {_written(positions[worst])} m is {distances[worst]:.3g} m off the "
            f"mesh of {shapes.source}, which lies between {_written(low)} and {_written(high)} m"
            f"{f' ({len(off)} sensors are off)' if len(off) > 1 else ''}. Give places in the "
            "mesh's axes and in metres."
        )
    found: Real = np.einsum("pk,mpkx->mpx", weights, shapes.vectors[:, corners])
    return found


def _check_units(shapes: Shapes, positions: Real) -> None:
    """Places that all lie in one spot of the mesh are in another unit than it."""
    apart = np.unique(positions, axis=0)
    span = float(np.linalg.norm(np.ptp(apart, axis=0))) if len(apart) >= _SEVERAL else np.inf
    if span < _FAR * shapes.extent:
        raise InputError(
            f"The sensors lie within {span:.3g} m of each other on the mesh of {shapes.source}, "
            f"which is {shapes.extent:.3g} m long. Is it in millimetres? Give both in metres."
        )


def _nearest(shapes: Shapes, positions: Real) -> tuple[Integers, Real, Real]:
    """Corners (n, 3) and weights (n, 3) of the nearest point on any face, distances (n,)."""
    a, b, c = np.moveaxis(shapes.points[shapes.triangles], 1, 0)
    corners = np.zeros((len(positions), 3), np.intp)
    weights, distances = np.zeros((len(positions), 3)), np.zeros(len(positions))
    for place, position in enumerate(positions):
        share = closest(position, a, b, c)
        points = share[:, :1] * a + share[:, 1:2] * b + share[:, 2:] * c
        apart = np.linalg.norm(points - position, axis=1)
        best = int(apart.argmin())
        corners[place], weights[place] = shapes.triangles[best], share[best]
        distances[place] = apart[best]
    return corners, weights, distances


def closest(position: Real, a: Real, b: Real, c: Real) -> Real:
    """Barycentric coordinates of the points of triangles that are closest to a position; (n, 3).

    Inside, those of the projection; outside, the best of the three sides, each cut to its length.

    Args:
        position: (3,).
        a: first corners; (n, 3).
        b: second corners; (n, 3).
        c: third corners; (n, 3).
    """
    one, two, away = b - a, c - a, position - a
    aa, ab, bb = (_dot(*pair) for pair in ((one, one), (one, two), (two, two)))
    pa, pb = _dot(away, one), _dot(away, two)
    area = aa * bb - ab**2
    flat = area <= 1e-14 * aa * bb
    safe = np.where(flat, 1.0, area)
    v, w = (bb * pa - ab * pb) / safe, (aa * pb - ab * pa) / safe
    inside = ~flat & (v >= 0) & (w >= 0) & (v + w <= 1)
    found = np.column_stack([1 - v - w, v, w])
    best = np.where(inside, 0.0, np.inf)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        start, end = (a, b, c)[first], (a, b, c)[second]
        side = end - start
        length = np.maximum(_dot(side, side), 1e-300)
        along = np.clip(_dot(position - start, side) / length, 0.0, 1.0)
        apart = np.linalg.norm(position - start - along[:, None] * side, axis=1)
        better = ~inside & (apart < best)
        share = np.zeros_like(found)
        share[:, first], share[:, second] = 1 - along, along
        found[better], best[better] = share[better], apart[better]
    return found


def _dot(one: Real, other: Real) -> Real:
    found: Real = (one * other).sum(axis=-1)
    return found


def _written(point: Real) -> str:
    return f"({', '.join(f'{x:.3g}' for x in point)})"
