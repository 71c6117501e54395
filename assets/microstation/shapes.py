"""Closed shells of plain shapes, every face turned outward: (points (n, 3), triangles (m, 3))."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Shell = tuple[NDArray[np.float64], NDArray[np.intp]]
Span = tuple[float, float]


def box(x: Span, y: Span, z: Span) -> Shell:
    """A block between its limits on each axis [m]."""
    return prism([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])], z)


def prism(outline: ArrayLike, z: Span) -> Shell:
    """A convex outline in x and y, counter-clockwise, raised from z[0] to z[1] [m]."""
    return between(outline, outline, z)


def between(lower: ArrayLike, upper: ArrayLike, z: Span) -> Shell:
    """Convex outlines of as many points at two heights, joined by straight walls [m]."""
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    n = len(low)
    points = np.vstack([np.c_[low, np.full(n, z[0])], np.c_[high, np.full(n, z[1])]])
    fan = np.array([[0, k, k + 1] for k in range(1, n - 1)])
    return points, np.vstack([fan[:, ::-1], fan + n, _walls(n)])


def lying(outline: ArrayLike, y: Span) -> Shell:
    """A convex outline in x and z, counter-clockwise seen from -y, drawn from y[0] to y[1] [m]."""
    points, triangles = prism(outline, (-y[1], -y[0]))
    return np.c_[points[:, 0], -points[:, 2], points[:, 1]], triangles


def ring(outer: ArrayLike, inner: ArrayLike, z: Span) -> Shell:
    """An outline with an opening, both of as many points, raised from z[0] to z[1] [m]."""
    outside, inside = np.asarray(outer, float), np.asarray(inner, float)
    n = len(outside)
    flat = np.vstack([outside, inside])
    points = np.vstack([np.c_[flat, np.full(2 * n, height)] for height in z])
    start = np.arange(n)
    end = (start + 1) % n
    top = np.vstack([np.c_[start, end, end + n], np.c_[start, end + n, start + n]])
    wall = np.vstack([np.c_[start, end, end + 2 * n], np.c_[start, end + 2 * n, start + 2 * n]])
    return points, np.vstack([top[:, ::-1], top + 2 * n, wall, wall[:, ::-1] + n])


def turned(profile: Sequence[tuple[float, float]], sides: int) -> Shell:
    """A turned part about z: radius and height of its outline, from the lowest to the highest [m].

    The outline starts and ends on the axis; its corners in between have a radius.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.c_[np.cos(angle), np.sin(angle)]
    rings = [np.c_[radius * circle, np.full(sides, z)] for radius, z in profile[1:-1]]
    ends = np.array([[0, 0, profile[0][1]], [0, 0, profile[-1][1]]])
    start = np.arange(sides)
    end = (start + 1) % sides
    last = (len(rings) - 1) * sides
    low, high = len(rings) * sides, len(rings) * sides + 1
    faces = [np.c_[end, start, np.full(sides, low)]]
    faces += [_walls(sides) + k * sides for k in range(len(rings) - 1)]
    faces += [np.c_[start + last, end + last, np.full(sides, high)]]
    return np.vstack([*rings, ends]), np.vstack(faces)


def round_outline(radius: float, sides: int, centre: ArrayLike = (0.0, 0.0)) -> NDArray[np.float64]:
    """A regular polygon about a centre, a side across the x axis; (sides, 2)."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.asarray(centre, float) + radius * np.c_[np.cos(angle), np.sin(angle)]


def bevelled(x: Span, y: Span, bevel: float) -> NDArray[np.float64]:
    """A rectangle with its corners cut off by 45 degrees, counter-clockwise; (8, 2)."""
    return np.array(
        [
            *((x[0] + bevel, y[0]), (x[1] - bevel, y[0]), (x[1], y[0] + bevel)),
            *((x[1], y[1] - bevel), (x[1] - bevel, y[1]), (x[0] + bevel, y[1])),
            *((x[0], y[1] - bevel), (x[0], y[0] + bevel)),
        ]
    )


def together(shells: Sequence[Shell]) -> Shell:
    """Several shells as one mesh."""
    counts = np.cumsum([0, *(len(points) for points, _ in shells)])
    triangles = [faces + count for (_, faces), count in zip(shells, counts, strict=False)]
    return np.vstack([points for points, _ in shells]), np.vstack(triangles)


def _walls(n: int) -> NDArray[np.intp]:
    """Walls from the ring of points 0..n-1 up to the ring n..2n-1."""
    start = np.arange(n)
    end = (start + 1) % n
    return np.vstack([np.c_[start, end, end + n], np.c_[start, end + n, start + n]])
