"""Shapes at sensors: at the nearest point of the mesh, or interpolated on the nearest face."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from identification.shapes.fe_file import Shapes
from identification.words import InputError, Integers, Real

ShapeSampling = Literal["interpolated", "nearest"]
_MIN_PLACES_FOR_UNITS = 3  # distinct places from which on the span of all shows a wrong unit
# Distance of a sensor from the mesh over the mesh's extent, at most: a sensor has a height, and a
# panel a thickness.
_MAX_OFFSET_SHARE = 0.02


def shapes_at(
    shapes: Shapes,
    positions: Real,
    names: Sequence[str],
    *,
    sampling: ShapeSampling = "interpolated",
    max_distance: float | None = None,
) -> Real:
    """Compute the displacements of all modes at some places.

    Args:
        shapes: modes on a mesh.
        positions: the places [m]; (n, 3).
        names: names of the places, for messages; n.
        sampling: ``interpolated`` on the nearest face, linear between its corners, or those of the
            ``nearest`` point.
        max_distance: distance of a place from the mesh, at most [m]; 2 % of the mesh's diagonal if
            None.

    Returns:
        Displacements in world axes; (n_mode, n, 3).

    Raises:
        InputError: a place off the mesh, by name, with the distance; places in other units.
    """
    if sampling == "nearest":
        distances_to_points = np.linalg.norm(shapes.points[None] - positions[:, None], axis=2)
        corners, weights = distances_to_points.argmin(axis=1)[:, None], np.ones((len(positions), 1))
        distances = distances_to_points.min(axis=1)
    else:
        corners, weights, distances = _nearest_on_faces(shapes, positions)
    limit = _MAX_OFFSET_SHARE * shapes.extent if max_distance is None else max_distance
    _check_units(shapes, positions)
    too_far = np.flatnonzero(~(distances <= limit))
    if len(too_far):
        worst = int(too_far[distances[too_far].argmax()])
        low, high = shapes.points.min(axis=0), shapes.points.max(axis=0)
        raise InputError(
            f"{names[worst]} at {_format_point(positions[worst])} m is {distances[worst]:.3g} m "
            f"off the mesh of {shapes.source}, which lies between {_format_point(low)} and "
            f"{_format_point(high)} m"
            f"{f' ({len(too_far)} sensors are off)' if len(too_far) > 1 else ''}. Give places in "
            "the mesh's axes and in metres."
        )
    return np.einsum("pk,mpkx->mpx", weights, shapes.vectors[:, corners])


def _check_units(shapes: Shapes, positions: Real) -> None:
    """Refuse places that all lie in one spot of the mesh, which shows a difference of units."""
    distinct = np.unique(positions, axis=0)
    span = (
        float(np.linalg.norm(np.ptp(distinct, axis=0)))
        if len(distinct) >= _MIN_PLACES_FOR_UNITS
        else np.inf
    )
    if span < _MAX_OFFSET_SHARE * shapes.extent:
        raise InputError(
            f"The sensors lie within {span:.3g} m of each other on the mesh of {shapes.source}, "
            f"which is {shapes.extent:.3g} m long. Is it in millimetres? Give both in metres."
        )


def _nearest_on_faces(shapes: Shapes, positions: Real) -> tuple[Integers, Real, Real]:
    """Return corners (n, 3) and weights (n, 3) of the nearest point on any face, distances (n,)."""
    a, b, c = np.moveaxis(shapes.points[shapes.triangles], 1, 0)
    corners = np.zeros((len(positions), 3), np.intp)
    weights, distances = np.zeros((len(positions), 3)), np.zeros(len(positions))
    for number, position in enumerate(positions):
        share = closest_barycentric(position, a, b, c)
        points = share[:, :1] * a + share[:, 1:2] * b + share[:, 2:] * c
        distance = np.linalg.norm(points - position, axis=1)
        best = int(distance.argmin())
        corners[number], weights[number] = shapes.triangles[best], share[best]
        distances[number] = distance[best]
    return corners, weights, distances


def closest_barycentric(position: Real, a: Real, b: Real, c: Real) -> Real:
    """Compute barycentric coordinates of the points of triangles closest to a position; (n, 3).

    Inside a triangle they are those of the projection. Outside they are the best of the three
    sides, each limited to its length.

    Args:
        position: (3,).
        a: first corners; (n, 3).
        b: second corners; (n, 3).
        c: third corners; (n, 3).
    """
    first_side, second_side, from_corner = b - a, c - a, position - a
    aa, ab, bb = (
        _row_products(*pair)
        for pair in (
            (first_side, first_side),
            (first_side, second_side),
            (second_side, second_side),
        )
    )
    pa, pb = _row_products(from_corner, first_side), _row_products(from_corner, second_side)
    area = aa * bb - ab**2
    is_degenerate = area <= 1e-14 * aa * bb
    safe = np.where(is_degenerate, 1.0, area)
    v, w = (bb * pa - ab * pb) / safe, (aa * pb - ab * pa) / safe
    inside = ~is_degenerate & (v >= 0) & (w >= 0) & (v + w <= 1)
    coordinates = np.column_stack([1 - v - w, v, w])
    best = np.where(inside, 0.0, np.inf)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        start, end = (a, b, c)[first], (a, b, c)[second]
        side = end - start
        length = np.maximum(_row_products(side, side), 1e-300)
        fraction = np.clip(_row_products(position - start, side) / length, 0.0, 1.0)
        distance = np.linalg.norm(position - start - fraction[:, None] * side, axis=1)
        better = ~inside & (distance < best)
        side_share = np.zeros_like(coordinates)
        side_share[:, first], side_share[:, second] = 1 - fraction, fraction
        coordinates[better], best[better] = side_share[better], distance[better]
    return coordinates


def _row_products(first: Real, second: Real) -> Real:
    """Return the scalar products of rows."""
    return (first * second).sum(axis=-1)


def _format_point(point: Real) -> str:
    """Return a point as text."""
    return f"({', '.join(f'{x:.3g}' for x in point)})"
