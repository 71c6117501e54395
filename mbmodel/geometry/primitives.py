"""Closed triangle meshes of box, cylinder, ellipsoid and capsule, with outward faces."""

import numpy as np

from identification.words import Integers, Real

_CORNERS_OF_CIRCLE = 32
_RINGS_TO_POLE = 8  # from the equator of an ellipsoid


def box(half: Real) -> tuple[Real, Integers]:
    """Return corners and triangles of a box about the origin.

    Args:
        half: half of its edges [m]; (3,).

    Returns:
        Vertices [m] (8, 3), and triangles, counter-clockwise seen from outside (12, 3).
    """
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return corners * half, np.array(halves, np.intp)


def capsule(radii: Real, half_length: float) -> tuple[Real, Integers]:
    """Return an ellipsoid about the origin, its halves separated along z by a cylinder.

    Args:
        radii: of the ellipsoid [m]; (3,).
        half_length: half the length of the cylinder [m]; 0 for none.

    Returns:
        Vertices and triangles as of ``box``.
    """
    rising = np.linspace(0, np.pi / 2, _RINGS_TO_POLE + 1)[:-1]
    latitudes = [*(-rising[::-1]), *(rising if half_length else rising[1:])]
    middle = len(rising)
    rings = [
        (np.cos(angle), np.sin(angle) * radii[2] + half_length * (1 if k >= middle else -1))
        for k, angle in enumerate(latitudes)
    ]
    top = radii[2] + half_length
    return _revolve(radii[:2], rings, (-top, top))


def cylinder(radius: float, half_length: float) -> tuple[Real, Integers]:
    """Return a cylinder about z; see ``box``.

    Args:
        radius: [m].
        half_length: [m].
    """
    rings = [(1.0, -half_length), (1.0, half_length)]
    return _revolve(np.array([radius, radius]), rings, (-half_length, half_length))


def _revolve(
    radii: Real, rings: list[tuple[float, float]], ends: tuple[float, float]
) -> tuple[Real, Integers]:
    """Return a closed surface of rings about z, with a point at each end.

    Args:
        radii: along x and y [m]; (2,).
        rings: relative radius and height [m] of each, from bottom to top.
        ends: heights of the end points [m].
    """
    angle = 2 * np.pi * np.arange(_CORNERS_OF_CIRCLE) / _CORNERS_OF_CIRCLE
    circle = np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle)], axis=1)
    points = [np.column_stack([size * circle, np.full(_CORNERS_OF_CIRCLE, z)]) for size, z in rings]
    vertices = np.vstack([*points, [[0, 0, ends[0]], [0, 0, ends[1]]]])
    here = np.arange(_CORNERS_OF_CIRCLE)
    following = (here + 1) % _CORNERS_OF_CIRCLE
    bottom, top = len(vertices) - 2, len(vertices) - 1
    parts = [np.column_stack([np.full(_CORNERS_OF_CIRCLE, bottom), following, here])]
    for ring in range(len(rings) - 1):
        low, high = ring * _CORNERS_OF_CIRCLE, (ring + 1) * _CORNERS_OF_CIRCLE
        parts.append(np.column_stack([low + here, low + following, high + following]))
        parts.append(np.column_stack([low + here, high + following, high + here]))
    last = (len(rings) - 1) * _CORNERS_OF_CIRCLE
    parts.append(np.column_stack([np.full(_CORNERS_OF_CIRCLE, top), last + here, last + following]))
    return vertices, np.vstack(parts).astype(np.intp)
