"""Triangles of box, cylinder, ellipsoid and capsule, closed and turned outwards."""

import numpy as np

from identification.words import Integers, Real

_AROUND, _RINGS = 32, 8  # corners of a circle; rings from equator to pole


def box(half: Real) -> tuple[Real, Integers]:
    """Corners and triangles of a box about the origin.

    Args:
        half: half of its edges [m]; (3,).

    Returns:
        Vertices [m]; (8, 3), and triangles, anticlockwise seen from outside; (12, 3).
    """
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return corners * half, np.array(halves, np.intp)


def capsule(radii: Real, half_length: float) -> tuple[Real, Integers]:
    """An ellipsoid about the origin, its halves apart along z with a cylinder between; see ``box``.

    Args:
        radii: of the ellipsoid [m]; (3,).
        half_length: of the cylinder [m]; 0 for none.
    """
    rising = np.linspace(0, np.pi / 2, _RINGS + 1)[:-1]
    latitudes = [*(-rising[::-1]), *(rising if half_length else rising[1:])]
    middle = len(rising)
    rings = [
        (np.cos(angle), np.sin(angle) * radii[2] + half_length * (1 if k >= middle else -1))
        for k, angle in enumerate(latitudes)
    ]
    top = radii[2] + half_length
    return _turned(radii[:2], rings, (-top, top))


def cylinder(radius: float, half_length: float) -> tuple[Real, Integers]:
    """A cylinder about z; see ``box``."""
    rings = [(1.0, -half_length), (1.0, half_length)]
    return _turned(np.array([radius, radius]), rings, (-half_length, half_length))


def _turned(
    radii: Real, rings: list[tuple[float, float]], ends: tuple[float, float]
) -> tuple[Real, Integers]:
    """Rings of relative radius and height from bottom to top, closed by a point at each end."""
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    circle = np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle)], axis=1)
    points = [np.column_stack([size * circle, np.full(_AROUND, z)]) for size, z in rings]
    vertices = np.vstack([*points, [[0, 0, ends[0]], [0, 0, ends[1]]]])
    here = np.arange(_AROUND)
    following = (here + 1) % _AROUND
    bottom, top = len(vertices) - 2, len(vertices) - 1
    parts = [np.column_stack([np.full(_AROUND, bottom), following, here])]
    for ring in range(len(rings) - 1):
        low, high = ring * _AROUND, (ring + 1) * _AROUND
        parts.append(np.column_stack([low + here, low + following, high + following]))
        parts.append(np.column_stack([low + here, high + following, high + here]))
    last = (len(rings) - 1) * _AROUND
    parts.append(np.column_stack([np.full(_AROUND, top), last + here, last + following]))
    return vertices, np.vstack(parts).astype(np.intp)
