"""Whether triangles bound a solid: closed, turned alike, each shell the right way round."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from identification.words import InputError, Integers, Mask, Real

# Two units in the last place of single precision, in which STL files hold their numbers.
_SAME_PLACE = 2.5e-7


def merged(points: Real, triangles: Integers) -> tuple[Real, Integers]:
    """Points at one place become one, and triangles that thereby lose an edge are dropped.

    STL repeats every corner for each of its triangles. Places count as one within two units in
    the last place of single precision of the largest coordinate, so that programs that round the
    two sides of an edge apart are understood; this moves volumes by some 1e-7 of themselves.
    """
    if not len(triangles):
        raise InputError("it has no cells: give a mesh with triangles or tetrahedra")
    # Whole copies first: a tree of them would have to list every pair.
    unique, first = np.unique(points, axis=0, return_inverse=True)
    near = cKDTree(unique).query_pairs(
        _SAME_PLACE * float(np.abs(unique).max()), output_type="ndarray"
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

    Sums over a surface are those of a volume exactly where its boundary vanishes: each edge is
    run through as often one way as the other. That is once each on a single shell; where shells
    that were exported together touch along an edge it is twice each.

    Raises:
        InputError: edges without a partner, or run through twice one way; repeated triangles.
    """
    _refuse_repeated(points, triangles)
    ends, _, net, count = _edges(triangles)
    _refuse_edges(points, ends, (net != 0) & (count == 1), "belong to one face only", "close it")
    _refuse_edges(
        points, ends, (net != 0) & (count == 2), "join faces turned against each other",
        "turn the faces alike, outward",
    )  # fmt: skip
    _refuse_edges(
        points, ends, net != 0, "join three or more faces that bound no volume",
        "remove the faces inside",
    )  # fmt: skip


def check_shells(points: Real, triangles: Integers) -> None:
    """Refuse a shell that is inside out on its own, and one that fills what is full.

    A shell of negative volume is a cavity if the others wind about it, one of positive volume must
    not lie inside the others (winding number, van Oosterom and Strackee 1983, eq. 8). Asked at the
    shell's six outermost points: shells that overlap in part are not found, and count twice.

    Raises:
        InputError: a shell is the wrong way round.
    """
    shell_of = _shells(triangles)
    if not shell_of.any():
        return
    for shell in range(shell_of.max() + 1):
        own = shell_of == shell
        corners = points[triangles[own]]
        others = points[triangles[~own]]
        volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        outer = corners.reshape(-1, 3)
        probes = outer[np.r_[outer.argmin(axis=0), outer.argmax(axis=0)]]
        winding = [winding_number(others - probe) for probe in probes]
        place = place_text(outer.mean(axis=0))
        if volume < 0 and max(winding) < 0.25:
            raise InputError(f"its part near {place} is inside out: turn the faces of that part")
        if volume > 0 and min(winding) > 0.75:
            raise InputError(
                f"its part near {place} lies inside another and would count twice: remove it, or "
                "turn its faces to make it a cavity"
            )


def _shells(triangles: Integers) -> Integers:
    """Number of each triangle's connected surface; (m,).

    Faces hang together where an edge joins just two. Where four meet, shells touch; only if a
    surface is not closed without such edges do these join too.
    """
    _, which, _, count = _edges(triangles)
    single = _joined(which, count == 2)
    for shell in range(single.max() + 1):
        _, _, net, _ = _edges(triangles[single == shell])
        if net.any():
            return _joined(which, count > 0)
    return single


def _joined(which: Integers, through: Mask) -> Integers:
    """Connected triangles, through the edges that count; ``which`` is (m, 3) edge numbers."""
    rows = np.repeat(np.arange(len(which)), 3)
    columns = len(which) + which.ravel()
    used = through[which.ravel()]
    size = len(which) + len(through)
    graph = coo_array((np.ones(used.sum()), (rows[used], columns[used])), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    _, shell = np.unique(label[: len(which)], return_inverse=True)
    return shell.astype(np.intp)


def _edges(triangles: Integers) -> tuple[Integers, Integers, Integers, Integers]:
    """Edges, their number at each triangle's sides, runs up less runs down, and all runs."""
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ends, which = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    which = which.ravel()
    up = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    net = np.zeros(len(ends), np.intp)
    np.add.at(net, which, up)
    return ends, which.reshape(-1, 3), net, np.bincount(which, minlength=len(ends))


def _refuse_edges(points: Real, ends: Integers, bad: Mask, what: str, remedy: str) -> None:
    if bad.any():
        place = place_text(points[ends[bad.argmax()]].mean(axis=0))
        raise InputError(
            f"its surface is not that of a solid: {bad.sum()} of {len(ends)} edges {what}, the "
            f"first near {place}: {remedy}"
        )


def _refuse_repeated(points: Real, triangles: Integers) -> None:
    turn = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    same_start = np.take_along_axis(triangles, turn, axis=1)
    faces, count = np.unique(same_start, axis=0, return_counts=True)
    if count.max(initial=0) > 1:
        place = place_text(points[faces[count.argmax()]].mean(axis=0))
        raise InputError(
            f"{(count > 1).sum()} of its triangles are there more than once, the first near "
            f"{place}: remove the copies"
        )


def winding_number(corners: Real) -> float:
    """How often triangles wind about the origin: the sum of their solid angles over 4 pi.

    The triangle in whose plane the origin lies counts as zero, so on a face the number is a half.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    upper = np.einsum("ni,ni->n", a, np.cross(b, c))
    lower = la * lb * lc
    upper[np.abs(upper) <= 1e-5 * lower] = 0.0
    for one, two, length in ((a, b, lc), (b, c, la), (c, a, lb)):
        lower = lower + np.einsum("ni,ni->n", one, two) * length
    return float(np.arctan2(upper, lower)[upper != 0].sum() / (2 * np.pi))


def place_text(point: Real) -> str:
    """A point, for a message."""
    return "(" + ", ".join(f"{round(float(value), 9) + 0.0:.4g}" for value in point) + ")"
