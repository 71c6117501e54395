"""What a machine looks like at rest: surfaces of its geoms, lines of its tendons, and edges."""

from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Integers, Real, frozen
from mbmodel.geometry.primitives import box, capsule, cylinder
from mbmodel.linearisation.equilibrium import settle
from mbmodel.machine import Machine
from mbmodel.mjcf.read import compile_mjcf
from mbmodel.mjcf.tendons import branches, is_fixed

_GROUPS = 3  # the viewer shows groups 0 to 2
_UNCOLOURED = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's default
_SHARP = np.cos(np.radians(30))
_MANY = 20_000  # triangles of one mesh beyond which it is simplified
_GEOM = mujoco.mjtGeom

Colour = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that move with one stage, in world axes.

    Args:
        stage: name of the body; None for the world, which stands still.
        vertices: [m]; (n, 3).
        triangles: numbers of their corners, anticlockwise seen from outside; (m, 3).
        edges: numbers of the ends of lines that outline it; (k, 2).
        colour: red, green, blue, opacity of 0..1; None where the MJCF states none.
    """

    stage: str | None
    vertices: Real
    triangles: Integers
    edges: Integers
    colour: Colour | None

    def __post_init__(self) -> None:
        """Freeze."""
        for name, kind, width in (
            ("vertices", np.float64, 3),
            ("triangles", np.intp, 3),
            ("edges", np.intp, 2),
        ):
            value = getattr(self, name)
            object.__setattr__(self, name, frozen(value, kind, (len(value), width), name))


@dataclass(frozen=True, eq=False)
class Line:
    """A piece of a spatial tendon, each of its points on a stage.

    Args:
        name: of the tendon.
        points: [m]; (n, 3).
        stages: what each point moves with; None for the world.
        colour: as of a surface.
    """

    name: str
    points: Real
    stages: tuple[str | None, ...]
    colour: Colour | None


@dataclass(frozen=True, eq=False)
class Looks:
    """Surfaces and lines of a machine.

    Args:
        surfaces: of its geoms.
        lines: of its spatial tendons.
        boxed: stages without a geom, of which a small box at the centre of mass stands.
    """

    surfaces: tuple[Surface, ...]
    lines: tuple[Line, ...]
    boxed: tuple[str, ...]


def looks(machine: Machine) -> Looks:
    """Surfaces and lines of a machine at its static equilibrium.

    Geoms of the groups that MuJoCo's viewer shows by default; planes and height fields are left
    out.

    Raises:
        InputError: the MJCF is no longer what the machine was read from.
    """
    model = compile_mjcf(machine.source)
    data = settle(model, machine.source).data
    moving = [b for b in range(1, model.nbody) if model.body_weldid[b] == b]
    names: dict[int, str | None] = {0: None}
    names.update(zip(moving, machine.layout.bodies, strict=True))
    stage_of = [names[int(weld)] for weld in model.body_weldid]
    shown = [_surface(model, data, geom, stage_of) for geom in range(model.ngeom)]
    surfaces = [surface for surface in shown if surface is not None]
    seen = {surface.stage for surface in surfaces}
    boxed = tuple(name for name in machine.layout.bodies if name not in seen)
    return Looks((*surfaces, *_boxes(machine, boxed)), tuple(_lines(model, data, stage_of)), boxed)


def _surface(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, stage_of: list[str | None]
) -> Surface | None:
    colour = _colour(model, geom)
    if model.geom_group[geom] >= _GROUPS or colour[3] == 0:
        return None
    triangulated = _triangulated(model, geom)
    if triangulated is None:
        return None
    points, triangles = triangulated
    axes = data.geom_xmat[geom].reshape(3, 3)
    return Surface(
        stage_of[model.geom_bodyid[geom]],
        points @ axes.T + data.geom_xpos[geom],
        triangles,
        sharp_edges(points, triangles),
        None if colour == _UNCOLOURED else colour,
    )


def _colour(model: mujoco.MjModel, geom: int) -> Colour:
    """A geom's own colour, else that of its material."""
    own = tuple(np.round(model.geom_rgba[geom].astype(float), 4).tolist())
    material = model.geom_matid[geom]
    if own == _UNCOLOURED and material >= 0:
        own = tuple(np.round(model.mat_rgba[material].astype(float), 4).tolist())
    red, green, blue, opacity = own
    return red, green, blue, opacity


def _triangulated(model: mujoco.MjModel, geom: int) -> tuple[Real, Integers] | None:
    """Vertices and triangles in the frame of the geom."""
    kind, size = _GEOM(model.geom_type[geom]), model.geom_size[geom]
    if kind == _GEOM.mjGEOM_BOX:
        return box(size)
    if kind == _GEOM.mjGEOM_CYLINDER:
        return cylinder(size[0], size[1])
    if kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE):
        half_length = size[1] if kind == _GEOM.mjGEOM_CAPSULE else 0.0
        return capsule(np.full(3, size[0]), half_length)
    if kind == _GEOM.mjGEOM_ELLIPSOID:
        return capsule(size, 0.0)
    if kind == _GEOM.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[geom])
        first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
        start, number = int(mesh.faceadr[0]), int(mesh.facenum[0])
        points = model.mesh_vert[first : first + count].astype(float)
        return simplified(points, model.mesh_face[start : start + number].astype(np.intp))
    return None


def simplified(points: Real, triangles: Integers, limit: int = _MANY) -> tuple[Real, Integers]:
    """The same surface with at most so many triangles: close vertices are made one.

    Vertices in one cell of a cubic grid become their mean; the grid is made coarser until few
    enough triangles keep three corners.
    """
    cells = 256.0
    small, corners = points, triangles
    while len(corners) > limit:
        low, edge = points.min(axis=0), np.ptp(points, axis=0).max() / cells
        _, cell = np.unique(np.floor((points - low) / edge), axis=0, return_inverse=True)
        cell = cell.ravel()
        count = np.bincount(cell)
        small = np.stack([np.bincount(cell, axis) / count for axis in points.T], axis=1)
        corners = cell[triangles]
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        cells /= 1.4
    return small, corners


def sharp_edges(points: Real, triangles: Integers) -> Integers:
    """Edges where two triangles meet at more than 30 degrees, or that bound one only.

    Returns:
        Numbers of their ends; (n_edge, 2). If none is sharp, as of a ball, those in the planes of
        the coordinates; if there are none, all.
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(triangles)), 3)
    order = np.lexsort(sides.T)
    sides, owner = sides[order], owner[order]
    edges, first, count = np.unique(sides, axis=0, return_index=True, return_counts=True)
    kept = count != 2
    pairs = first[count == 2]
    kept[count == 2] = (normal[owner[pairs]] * normal[owner[pairs + 1]]).sum(axis=1) < _SHARP
    if not kept.any():
        flat = np.abs(points) <= 1e-9 * np.abs(points).max(initial=0.0)
        kept = (flat[edges[:, 0]] & flat[edges[:, 1]]).any(axis=1)
    outline: Integers = edges[kept] if kept.any() else edges
    return outline


def _boxes(machine: Machine, stages: tuple[str, ...]) -> list[Surface]:
    """Small cubes at centres of mass, so that something can be seen."""
    if not stages:
        return []
    centres = machine.layout.centres
    points = np.vstack([centres, machine.layout.positions])
    spread = float(np.linalg.norm(np.ptp(points, axis=0)))
    gaps = np.linalg.norm(centres[:, None] - centres, axis=2)
    gaps = gaps[gaps > 1e-6 * spread]
    size = min(0.2 * spread, 0.6 * float(gaps.min())) if gaps.size else 0.2 * spread
    size = max(size, 0.04 * spread) or 0.1
    vertices, triangles = box(np.full(3, size / 2))
    edges = sharp_edges(vertices, triangles)
    bodies = machine.layout.bodies
    return [
        Surface(name, vertices + centres[bodies.index(name)], triangles, edges, None)
        for name in stages
    ]


def _lines(model: mujoco.MjModel, data: mujoco.MjData, stage_of: list[str | None]) -> list[Line]:
    found = []
    for tendon in range(model.ntendon):
        if is_fixed(model, tendon) or model.tendon_group[tendon] >= _GROUPS:
            continue
        red, green, blue, opacity = np.round(model.tendon_rgba[tendon].astype(float), 4).tolist()
        colour = (red, green, blue, opacity)
        for _, points, bodies in branches(model, data, tendon):
            found.append(
                Line(
                    model.tendon(tendon).name or f"tendon{tendon}",
                    np.array(points),
                    tuple(stage_of[body] for body in bodies),
                    None if colour == _UNCOLOURED else colour,
                )
            )
    return found
