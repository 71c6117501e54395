"""Where the gondola's sensors sit and where it is struck: ``layout.toml``.

Fifteen places by effective independence of the drawing's first elastic modes along the normals of
its panels; the first, fourth and fifth are read along all three axes, as in the seed document.
"""

from dataclasses import dataclass

import numpy as np
from panels import LENGTH, SIDE, WIDTH, Panels, Real
from solver import Modes

from identification.shapes import effective_independence

TOLD = slice(6, 14)  # modes that the places are chosen for
PLACES, TRIAXIAL = 15, (1, 4, 5)
# Struck at the bow's corners and edges, and at the stern: point and direction.
STRUCK = {
    "bow1": ((LENGTH, WIDTH / 2, 1.2), "y"),
    "bow2": ((LENGTH, -WIDTH / 2, 1.8), "y"),
    "bow3": ((LENGTH, WIDTH / 2 - 0.2, 0.6), "x"),
    "stern1": ((0.0, 0.4, 1.2), "x"),
    "stern2": ((0.0, -0.2, 1.8), "x"),
    "stern3": ((0.0, -0.6, 0.6), "x"),
}


@dataclass(frozen=True, eq=False)
class Place:
    """A sensor or a struck point.

    Args:
        name: of the site.
        position: [m]; (3,).
        node: of the mesh there.
        axes: that are read or struck, of ``xyz``.
    """

    name: str
    position: Real
    node: int
    axes: str


def sensors(panels: Panels, modes: Modes) -> list[Place]:
    """The places of the sensors, in the order of the panels."""
    nodes, normals = _inside(panels)
    along = np.einsum("mnx,nx->mn", modes.shapes[TOLD][:, nodes], normals)
    chosen = effective_independence(along, PLACES)
    found = []
    for number, one in enumerate(chosen.tolist(), start=1):
        normal = "xyz"[int(np.abs(normals[one]).argmax())]
        axes = "xyz" if number in TRIAXIAL else normal
        found.append(Place(f"acc{number}", panels.points[nodes[one]], int(nodes[one]), axes))
    return found


def struck(panels: Panels) -> list[Place]:
    """The points that are struck."""
    found = []
    for name, (position, axis) in STRUCK.items():
        apart = np.linalg.norm(panels.points - np.array(position), axis=1)
        node = int(apart.argmin())
        if apart[node] > 1e-6:
            raise ValueError(f"no node at {name}")
        found.append(Place(name, panels.points[node], node, axis))
    return found


def layout(places: list[Place]) -> str:
    """As a layout.toml."""
    lines = []
    for place in places:
        position = ", ".join(f"{x:.6g}" for x in place.position)
        lines += [f"[site.{place.name}]", f"position = [{position}]  # {place.axes}", ""]
    return "\n".join(lines)


def _inside(panels: Panels) -> tuple[np.ndarray, Real]:
    """Corner nodes of one panel alone, and its normal there."""
    owners: dict[int, set[int]] = {}
    normals = np.zeros((len(panels.points), 3))
    for element in panels.elements:
        corners = panels.points[element[:4]]
        normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
        axis = int(np.abs(normal).argmax())
        for node in element[:4].tolist():
            owners.setdefault(node, set()).add(axis)
            normals[node] = np.eye(3)[axis]
    # Neighbours tell the same: every second node along the panel.
    steps = np.round(panels.points / SIDE).astype(int)
    even = ((steps % 2 == 0) | (normals != 0)).all(axis=1)
    nodes = np.array(sorted(n for n, axes in owners.items() if len(axes) == 1 and even[n]))
    return nodes, normals[nodes]
