"""Check that triangles bound a solid: closed, consistently oriented, each shell outward."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from identification.words import InputError, Integers, Mask, Real

# Two units in the last place of single precision (in which STL files hold their numbers), relative
# to the largest coordinate.
_SAME_POINT_DISTANCE = 2.5e-7
# Depth of the points that are tried for an overlap, over the smallest extent that shells share:
# surfaces that only touch do not count.
_PROBE_DEPTH = 1e-3
_MAX_PROBES = 2000  # for each pair of shells: an overlap of a percent of the surface is found
# Barycentric coordinates of a grid in a triangle.
_TRIANGLE_GRID = (
    np.array([(a, b, 8 - a - b) for a in range(1, 7) for b in range(1, 8 - a)], dtype=float) / 8
)


def merge_points(points: Real, triangles: Integers) -> tuple[Real, Integers]:
    """Merge points at one place, and drop triangles that thereby lose an edge.

    STL repeats every corner for each of its triangles. Points count as one within two units in
    the last place of single precision of the largest coordinate, because programs may round the
    two sides of an edge differently. This changes volumes by some 1e-7 of themselves.

    Args:
        points: [m]; (n, 3).
        triangles: corners; (m, 3).

    Returns:
        Points and triangles after merging.

    Raises:
        InputError: there are no triangles.
    """
    if not len(triangles):
        raise InputError("the mesh has no cells: give a mesh with triangles or tetrahedra")
    # Exact duplicates are merged first, since the search below would list every pair of them.
    unique, first = np.unique(points, axis=0, return_inverse=True)
    near = cKDTree(unique).query_pairs(
        _SAME_POINT_DISTANCE * float(np.abs(unique).max()), output_type="ndarray"
    )
    links = coo_array((np.ones(len(near)), near.T), shape=(len(unique), len(unique)))
    count, place = connected_components(links, directed=False)
    together = np.empty((count, 3))
    together[place[::-1]] = unique[::-1]
    corners: Integers = place[first.ravel()][triangles].astype(np.intp)
    start, middle, end = corners.T
    return together, corners[(start != middle) & (middle != end) & (end != start)]


def check_surface(points: Real, triangles: Integers) -> None:
    """Refuse triangles that do not bound a volume.

    A surface sum equals a volume integral exactly if the surface has no boundary: each edge is
    run through equally often in both directions. On a single shell this is once each; where shells
    that were exported together touch along an edge, it is twice each.

    Args:
        points [m] (n, 3), triangles (m, 3): as for ``merge_points``.

    Raises:
        InputError: edges without a partner, or run through twice one way; repeated triangles.
    """
    _refuse_repeated(points, triangles)
    ends, _, net, count = _edges(triangles)
    _refuse_edges(points, ends, (net != 0) & (count == 1), "belong to one face only", "close it")
    _refuse_edges(
        points, ends, (net != 0) & (count == 2), "join faces turned against each other",
        "turn all faces outward",
    )  # fmt: skip
    _refuse_edges(
        points, ends, net != 0, "join three or more faces that bound no volume",
        "remove the faces inside the body",
    )  # fmt: skip


def check_shells(points: Real, triangles: Integers) -> None:
    """Refuse a shell that is inside out on its own, and a shell inside solid material.

    A shell of negative volume is a cavity if the other shells wind about it; a shell of positive
    volume must not lie inside the others. Both are decided by the winding number (van Oosterom and
    Strackee 1983, eq. 8) at the shell's six outermost points. ``find_overlap`` finds shells that
    overlap in part.

    Args:
        points: [m]; (n, 3).
        triangles: corners of a closed surface; (m, 3).

    Raises:
        InputError: a shell is the wrong way round.
    """
    shell_of = _shells(triangles)
    if not shell_of.any():
        return
    for shell in range(shell_of.max() + 1):
        in_shell = shell_of == shell
        corners = points[triangles[in_shell]]
        rest = points[triangles[~in_shell]]
        volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        outer = corners.reshape(-1, 3)
        probes = outer[np.r_[outer.argmin(axis=0), outer.argmax(axis=0)]]
        winding = [winding_number(rest - probe) for probe in probes]
        place = point_text(outer.mean(axis=0))
        if volume < 0 and max(winding) < 0.25:
            raise InputError(f"the part near {place} is inside out: reverse the faces of that part")
        if volume > 0 and min(winding) > 0.75:
            raise InputError(
                f"the part near {place} lies inside another and would count twice: remove it, or "
                "reverse its faces to make it a cavity"
            )


def find_overlap(points: Real, triangles: Integers) -> Real | None:
    """Return a point at which two solid shells overlap in part, or None.

    Points just below the surface of one shell, on a grid of each triangle within the extent that
    both have, are inside the other where the winding number about them is one.

    Args:
        points: [m]; (n, 3).
        triangles: corners of a closed surface; (m, 3).
    """
    shell_of = _shells(triangles)
    for first in range(shell_of.max() + 1):
        for second in range(shell_of.max() + 1):
            faces, neighbours = (points[triangles[shell_of == k]] for k in (first, second))
            if first != second and (place := _find_inside(faces, neighbours)) is not None:
                return place
    return None


def _find_inside(faces: Real, neighbours: Real) -> Real | None:
    """Return a point just below some faces that is inside other faces, or None.

    Args:
        faces: corners [m]; (n, 3, 3).
        neighbours: corners of the faces of another shell [m]; (m, 3, 3).
    """
    lowest = np.maximum(faces.min(axis=(0, 1)), neighbours.min(axis=(0, 1)))
    highest = np.minimum(faces.max(axis=(0, 1)), neighbours.max(axis=(0, 1)))
    if (lowest >= highest).any():
        return None
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    depth = _PROBE_DEPTH * float((highest - lowest).min())
    probes = np.einsum("gc,ncd->ngd", _TRIANGLE_GRID, faces) - depth * normal[:, None]
    probes = probes.reshape(-1, 3)
    probes = probes[((probes > lowest) & (probes < highest)).all(axis=1)]
    for probe in probes[:: max(1, len(probes) // _MAX_PROBES)]:
        if winding_number(neighbours - probe) > 0.75:
            return probe
    return None


def _shells(triangles: Integers) -> Integers:
    """Return the number of each triangle's connected surface; (m,).

    Faces are connected through edges that join exactly two. Where four faces meet, shells touch;
    such edges connect faces only if a surface would not be closed without them.
    """
    _, which, _, count = _edges(triangles)
    single = _connected_triangles(which, count == 2)
    for shell in range(single.max() + 1):
        _, _, net, _ = _edges(triangles[single == shell])
        if net.any():
            return _connected_triangles(which, count > 0)
    return single


def _connected_triangles(which: Integers, through: Mask) -> Integers:
    """Return the number of each triangle's connected component; (m,).

    Args:
        which: edge numbers of each triangle; (m, 3).
        through: edges that connect; (n_edge,).
    """
    rows = np.repeat(np.arange(len(which)), 3)
    columns = len(which) + which.ravel()
    used = through[which.ravel()]
    size = len(which) + len(through)
    graph = coo_array((np.ones(used.sum()), (rows[used], columns[used])), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    _, shell = np.unique(label[: len(which)], return_inverse=True)
    return shell.astype(np.intp)


def _edges(triangles: Integers) -> tuple[Integers, Integers, Integers, Integers]:
    """Return edges, their numbers at each triangle's sides, net runs and all runs of each edge."""
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ends, which = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    which = which.ravel()
    up = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    net = np.zeros(len(ends), np.intp)
    np.add.at(net, which, up)
    return ends, which.reshape(-1, 3), net, np.bincount(which, minlength=len(ends))


def _refuse_edges(points: Real, ends: Integers, bad: Mask, what: str, remedy: str) -> None:
    """Raise InputError if any edge is bad, with the place of the first."""
    if bad.any():
        place = point_text(points[ends[bad.argmax()]].mean(axis=0))
        raise InputError(
            f"the surface does not bound a solid: {bad.sum()} of {len(ends)} edges {what}, the "
            f"first near {place}: {remedy}"
        )


def _refuse_repeated(points: Real, triangles: Integers) -> None:
    """Raise InputError if a triangle occurs more than once."""
    turn = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    same_start = np.take_along_axis(triangles, turn, axis=1)
    faces, count = np.unique(same_start, axis=0, return_counts=True)
    if count.max(initial=0) > 1:
        place = point_text(points[faces[count.argmax()]].mean(axis=0))
        raise InputError(
            f"{(count > 1).sum()} of the triangles occur more than once, the first near "
            f"{place}: remove the copies"
        )


def winding_number(corners: Real) -> float:
    """Return how often triangles wind about the origin: the sum of their solid angles over 4 pi.

    A triangle in whose plane the origin lies counts as zero, so the number is 1/2 on a face.

    Args:
        corners: [m]; (n, 3, 3).
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    upper = np.einsum("ni,ni->n", a, np.cross(b, c))
    lower = la * lb * lc
    upper[np.abs(upper) <= 1e-5 * lower] = 0.0
    for first, second, length in ((a, b, lc), (b, c, la), (c, a, lb)):
        lower = lower + np.einsum("ni,ni->n", first, second) * length
    return float(np.arctan2(upper, lower)[upper != 0].sum() / (2 * np.pi))


def point_text(point: Real) -> str:
    """Return a point as text for a message."""
    return "(" + ", ".join(f"{round(float(value), 9) + 0.0:.4g}" for value in point) + ")"
