"""Shapes with known mass properties, as points and triangles turned outward."""

import itertools

import meshio
import numpy as np

BOX_FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ]
)
BOX_TETRAHEDRA = np.array([[0, 1, 3, 4], [1, 2, 3, 6], [1, 6, 4, 5], [3, 4, 6, 7], [1, 3, 4, 6]])
L_OUTLINE = np.array([[0, 0], [0.7, 0], [0.7, 0.2], [0.25, 0.2], [0.25, 0.5], [0, 0.5]])
L_HEIGHT = 0.3


def box(size, centre=(0, 0, 0)):
    """Eight corners in the order of a hexahedron, twelve triangles."""
    corners = np.array(
        [*([-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]),
         *([-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1])]
    )  # fmt: skip
    return np.array(centre) + corners * np.array(size) / 2, BOX_FACES


def together(*shapes):
    """Several shapes as one list of points and triangles."""
    points, triangles, count = [], [], 0
    for corners, faces in shapes:
        points.append(corners)
        triangles.append(np.asarray(faces) + count)
        count += len(corners)
    return np.concatenate(points), np.concatenate(triangles)


def prism(outline, height, floor):
    """An upright prism; ``floor`` divides the outline into triangles, counter-clockwise."""
    n = len(outline)
    points = np.vstack([np.c_[outline, np.zeros(n)], np.c_[outline, np.full(n, height)]])
    floor = np.asarray(floor)
    start = np.arange(n)
    end = (start + 1) % n
    walls = [np.c_[start, end, end + n], np.c_[start, end + n, start + n]]
    return points, np.concatenate([floor[:, ::-1], floor + n, *walls])


def l_shape():
    """Not convex; two boxes without their common face."""
    return prism(L_OUTLINE, L_HEIGHT, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])


def box_solid(size, centre, density):
    """Mass, centre and inertia of a box: m / 12 (b^2 + c^2) and so on."""
    size = np.array(size)
    mass = density * size.prod()
    return mass, np.array(centre, float), mass / 12 * np.diag((size**2).sum() - size**2)


def sum_solids(*solids):
    """Parts joined to one body, by Steiner; a part of negative mass is a cavity."""
    mass = sum(part[0] for part in solids)
    centre = sum(part[0] * part[1] for part in solids) / mass
    inertia = np.zeros((3, 3))
    for part_mass, place, part_inertia in solids:
        arm = place - centre
        inertia += part_inertia + part_mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia


def l_solid(density):
    """The L as two boxes."""
    return sum_solids(
        box_solid((0.7, 0.2, L_HEIGHT), (0.35, 0.1, L_HEIGHT / 2), density),
        box_solid((0.25, 0.3, L_HEIGHT), (0.125, 0.35, L_HEIGHT / 2), density),
    )


def stl_text(points, triangles):
    """An STL file in text, every digit kept."""
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex " + " ".join(f"{x:.17g}" for x in points[k]) + "\n" for k in triangle)
        + "endloop\nendfacet\n"
        for triangle in triangles
    )
    return f"solid shape\n{facets}endsolid shape\n"


def obj_text(points, faces):
    """An OBJ file; faces may have any number of corners."""
    lines = ["v " + " ".join(f"{x:.17g}" for x in point) for point in points]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    return "\n".join(lines) + "\n"


def write_as(folder, kind, points, cells):
    """Write a mesh in one of the formats; cells by meshio's names."""
    suffix = kind.split()[0]
    path = folder / f"{kind.replace(' ', '_')}.{suffix}"
    if kind == "stl text":
        path.write_text(stl_text(points, cells["triangle"]), encoding="utf-8")
    elif kind == "stl solid":  # a binary file whose header begins like a text file's
        meshio.Mesh(points, cells).write(path, binary=True)
        path.write_bytes(b"solid" + path.read_bytes()[5:])
    elif suffix == "stl":
        meshio.Mesh(points, cells).write(path, binary=True)
    elif suffix == "obj":
        path.write_text(obj_text(points, itertools.chain(*cells.values())), encoding="utf-8")
    elif suffix == "msh":
        mesh = meshio.Mesh(points, cells)
        mesh.write(path, file_format=kind.split()[1], binary="binary" in kind)
    else:
        meshio.Mesh(points, cells).write(path)
    return path
