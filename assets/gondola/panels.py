"""The gondola's panels as a mesh of eight-node quadrilaterals, and what each of them weighs.

An open-fronted box after the seed document: bottom of two panels, stern, sides, top, an L-corner
on each side of the open bow. x points from stern to bow, y across, z up; the stern's foot is zero.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from equivalent_shell import DENSITY, PANEL, equal_bending_thickness
from numpy.typing import NDArray

Real = NDArray[np.float64]
LENGTH, WIDTH, HEIGHT = 1.4, 1.6, 2.4  # m
FLANGE = 0.2  # m, of an L-corner
SIDE = 0.2  # m, of an element
BOTTOM_PANELS = 2  # bonded; the bottom weighs as much
BOTTOM = equal_bending_thickness(BOTTOM_PANELS)  # m: 19.65 mm
EDGE = 1.5  # kg/m: joining sheets, fasteners, glue
BATTERY, BATTERIES = 18.0, ((0.1, 0.5), (0.1, -0.5), (0.5, 0.7), (0.5, -0.7))  # kg, at x, y
WHEEL, RADIUS = 45.0, 0.5  # kg on a ring, m
PLATE = 0.05  # m: as good as rigid below the wheel
WHEEL_AT = (0.9, 0.0)


@dataclass(frozen=True)
class Frame:
    """An inner frame: a mass that yields on its pins, in each direction at a frequency of its own.

    Args:
        mass: [kg].
        pins: where it hangs, (x, y, z) [m]; points of panels.
        frequencies: of the mass on its pins, were these at rest; along x, y, z [Hz].
    """

    mass: float
    pins: tuple[tuple[float, float, float], ...]
    frequencies: tuple[float, float, float]


@dataclass(frozen=True)
class Build:
    """What a gondola is made of.

    Args:
        bending: factor of the panels' modulus; a core that shears makes it less.
        density: factor of the panels' density.
        edges: factor of what the edges weigh.
        bottom: factor of the bottom's thickness, at the drawing's density.
        thickness: factors of panels by name, mass left as it is.
        lumps: further masses [kg] at points (x, y, z) [m].
        frames: inner frames.
    """

    bending: float = 1.0
    density: float = 1.0
    edges: float = 1.0
    bottom: float = 1.0
    thickness: Mapping[str, float] = field(default_factory=dict)
    lumps: tuple[tuple[float, tuple[float, float, float]], ...] = ()
    frames: tuple[Frame, ...] = ()


@dataclass(frozen=True, eq=False)
class Panels:
    """A mesh with a thickness and a density for each element.

    Args:
        points: (n_node, 3) [m].
        elements: corners, then the middles of the sides; (n_element, 8).
        thickness: (n_element,) [m].
        density: (n_element,) [kg/m3].
        area: (n_element,) [m2].
        names: of the panels; (n_element,).
    """

    points: Real
    elements: NDArray[np.intp]
    thickness: Real
    density: Real
    area: Real
    names: NDArray[np.str_]

    @property
    def mass(self) -> float:
        """In all [kg]."""
        return float((self.area * self.thickness * self.density).sum())


@dataclass
class _Mesh:
    """Quadrilaterals that share their nodes where they meet."""

    numbers: dict[tuple[int, ...], int] = field(default_factory=dict)
    elements: list[list[int]] = field(default_factory=list)
    panels: list[str] = field(default_factory=list)

    def node(self, point: Real) -> int:
        key = tuple(np.round(point / 1e-6).astype(int).tolist())
        return self.numbers.setdefault(key, len(self.numbers))

    def add(self, panel: str, size: tuple[float, float], place: Callable[[Real], Real]) -> None:
        """A rectangle of some size, put in place."""
        counts = [max(1, round(side / SIDE)) for side in size]
        steps = np.array(size) / counts
        for i in range(counts[0]):
            for j in range(counts[1]):
                around = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
                corners = [np.array([i + a / 2, j + b / 2]) * steps for a, b in around]
                self.elements.append([self.node(place(one)) for one in corners])
                self.panels.append(panel)


def panels_of(build: Build) -> Panels:
    """The mesh of a gondola."""
    mesh = _Mesh()
    half = WIDTH / 2
    mesh.add("bottom", (LENGTH, WIDTH), lambda p: np.array([p[0], p[1] - half, 0.0]))
    mesh.add("top", (LENGTH, WIDTH), lambda p: np.array([p[0], p[1] - half, HEIGHT]))
    mesh.add("stern", (WIDTH, HEIGHT), lambda p: np.array([0.0, p[0] - half, p[1]]))
    for side in (-1, 1):
        mesh.add("side", (LENGTH, HEIGHT), lambda p, s=side: np.array([p[0], s * half, p[1]]))  # type: ignore[misc]
        mesh.add(
            "corner",
            (FLANGE, HEIGHT),
            lambda p, s=side: np.array([LENGTH, s * (half - p[0]), p[1]]),  # type: ignore[misc]
        )
    points = np.array(list(mesh.numbers), float) * 1e-6
    elements = np.array(mesh.elements, np.intp)
    return _weighed(points, elements, np.array(mesh.panels), build)


def _weighed(
    points: Real, elements: NDArray[np.intp], panels: NDArray[np.str_], build: Build
) -> Panels:
    corners = points[elements[:, :4]]
    across = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = 0.5 * np.linalg.norm(np.cross(*across), axis=1)
    centres = corners.mean(axis=1)
    bottom = panels == "bottom"
    thickness = np.where(bottom, build.bottom * BOTTOM, PANEL)
    layers = np.where(bottom, build.bottom * BOTTOM_PANELS, 1.0)
    mass = area * layers * PANEL * DENSITY * build.density
    mass += build.edges * EDGE * _edges(elements, points)
    for place in BATTERIES:
        mass += _spread(BATTERY, bottom & _near(centres, np.array([*place, 0.0]), 0.25))
    wheel = bottom & (np.hypot(*(centres[:, :2] - WHEEL_AT).T) < RADIUS + 1e-6)
    mass += _spread(WHEEL, wheel)
    factors = [build.thickness.get(str(panel), 1.0) for panel in panels]
    thickness = np.where(wheel, PLATE, thickness * np.array(factors))
    for lump, place in build.lumps:
        distance = np.linalg.norm(centres - np.array(place), axis=1)
        mass += _spread(lump, distance < distance.min() + 0.5 * SIDE)
    return Panels(points, elements, thickness, mass / (area * thickness), area, panels)


def _near(centres: Real, place: Real, far: float) -> NDArray[np.bool_]:
    return np.abs(centres - place).max(axis=1) < far


def _spread(mass: float, chosen: NDArray[np.bool_]) -> Real:
    """A mass shared by some elements."""
    if not chosen.any():
        raise ValueError("no element below a mass: the mesh is too coarse")
    return np.where(chosen, mass / chosen.sum(), 0.0)


def _edges(elements: NDArray[np.intp], points: Real) -> Real:
    """Length of an element's sides where panels meet, a share for each of them; (n_element,)."""
    sides = np.sort(elements[:, [[0, 1], [1, 2], [2, 3], [3, 0]]], axis=2)
    flat = sides.reshape(-1, 2)
    unique, place, counts = np.unique(flat, axis=0, return_inverse=True, return_counts=True)
    length = np.linalg.norm(points[unique[:, 0]] - points[unique[:, 1]], axis=1)
    normals = _normals(elements, points)
    owners = np.repeat(np.arange(len(elements)), 4)
    bent = np.zeros(len(unique), bool)
    place = place.ravel()
    for side in np.flatnonzero(counts > 1):
        meeting = normals[owners[place == side]]
        bent[side] = np.abs(meeting @ meeting[0]).min() < 0.5
    shared = np.where(bent, length / counts, 0.0)
    found: Real = np.bincount(owners, weights=shared[place], minlength=len(elements))
    return found


def _normals(elements: NDArray[np.intp], points: Real) -> Real:
    corners = points[elements[:, :4]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    found: Real = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return found
