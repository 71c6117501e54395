"""Geometry of a machine at rest for pictures: surfaces of geoms, lines of tendons, edges."""

from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Integers, Real, frozen_array
from mbmodel.geometry.primitives import box, capsule, cylinder
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.machine import Machine
from mbmodel.mjcf.keyframes import choose_keyframe, pose_data
from mbmodel.mjcf.read import compile_mjcf
from mbmodel.mjcf.stages import stage_bodies, stage_numbers
from mbmodel.mjcf.tendons import is_fixed_tendon, tendon_branches

_SHOWN_GROUPS = 3  # groups 0 to 2, as in MuJoCo's viewer
_DEFAULT_COLOUR = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's default
_COS_SHARP_ANGLE = np.cos(np.radians(30))  # between normals: flatter edges are no outlines
_MAX_TRIANGLES = 20_000  # of one mesh: larger ones are simplified for display
_GEOM = mujoco.mjtGeom

Colour = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that move with one stage, in world axes.

    Args:
        stage: name of the body; None for the world, which stands still.
        vertices: [m]; (n, 3).
        triangles: numbers of their corners, counter-clockwise seen from outside; (m, 3).
        edges: numbers of the ends of outline edges; (k, 2).
        colour: red, green, blue, opacity of 0..1; None if the MJCF states none.
    """

    stage: str | None
    vertices: Real
    triangles: Integers
    edges: Integers
    colour: Colour | None

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        for name, kind, width in (
            ("vertices", np.float64, 3),
            ("triangles", np.intp, 3),
            ("edges", np.intp, 2),
        ):
            value = getattr(self, name)
            object.__setattr__(self, name, frozen_array(value, kind, (len(value), width), name))


@dataclass(frozen=True, eq=False)
class TendonLine:
    """A piece of a spatial tendon, each of its points on a stage.

    Args:
        name: of the tendon.
        points: [m]; (n, 3).
        stages: stage that each point moves with; None for the world.
        colour: as of a surface.
    """

    name: str
    points: Real
    stages: tuple[str | None, ...]
    colour: Colour | None


@dataclass(frozen=True, eq=False)
class MachineGeometry:
    """Surfaces and lines of a machine.

    Args:
        surfaces: of its geoms.
        lines: of its spatial tendons.
        boxed: stages without a geom, shown by a small box at their centre of mass.
    """

    surfaces: tuple[Surface, ...]
    lines: tuple[TendonLine, ...]
    boxed: tuple[str, ...]


def machine_geometry(machine: Machine) -> MachineGeometry:
    """Return surfaces and lines of a machine at its static equilibrium.

    Geoms of the groups that MuJoCo's viewer shows by default are included, but neither planes nor
    height fields.

    Args:
        machine: read from an MJCF that still exists.

    Raises:
        InputError: the MJCF has changed since the machine was read.
    """
    model, data, stage_names = pose_machine(machine)
    shown = [_surface(model, data, geom, stage_names) for geom in range(model.ngeom)]
    surfaces = [surface for surface in shown if surface is not None]
    with_geom = {surface.stage for surface in surfaces}
    boxed = tuple(name for name in machine.layout.bodies if name not in with_geom)
    return MachineGeometry(
        (*surfaces, *_boxes(machine, boxed)), tuple(_lines(model, data, stage_names)), boxed
    )


def pose_machine(
    machine: Machine,
) -> tuple[mujoco.MjModel, mujoco.MjData, list[str | None]]:
    """Return a machine's compiled MJCF at static equilibrium, and the stage of each MuJoCo body.

    Args:
        machine: read from an MJCF that still exists.

    Returns:
        Model, data, and the name of the stage of each body; None for the world.

    Raises:
        InputError: the MJCF has changed since the machine was read.
    """
    model = compile_mjcf(machine.source, machine.reading)
    start = pose_data(model, choose_keyframe(model, machine.source, machine.keyframe))
    data = find_equilibrium(model, machine.source, start).data
    moving = stage_bodies(model)
    names: dict[int, str | None] = {0: None}
    names.update(zip(moving, machine.layout.bodies, strict=True))
    return model, data, [names[number] for number in stage_numbers(model).tolist()]


def _surface(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, stage_names: list[str | None]
) -> Surface | None:
    """Return the surface of a geom, or None if it is not shown."""
    colour = _colour(model, geom)
    if model.geom_group[geom] >= _SHOWN_GROUPS or colour[3] == 0:
        return None
    triangulated = _triangulate(model, geom)
    if triangulated is None:
        return None
    points, triangles = triangulated
    axes = data.geom_xmat[geom].reshape(3, 3)
    return Surface(
        stage_names[model.geom_bodyid[geom]],
        points @ axes.T + data.geom_xpos[geom],
        triangles,
        sharp_edges(points, triangles),
        None if colour == _DEFAULT_COLOUR else colour,
    )


def _colour(model: mujoco.MjModel, geom: int) -> Colour:
    """Return a geom's own colour, or that of its material."""
    colour = tuple(np.round(model.geom_rgba[geom].astype(float), 4).tolist())
    material = model.geom_matid[geom]
    if colour == _DEFAULT_COLOUR and material >= 0:
        colour = tuple(np.round(model.mat_rgba[material].astype(float), 4).tolist())
    red, green, blue, opacity = colour
    return red, green, blue, opacity


def _triangulate(model: mujoco.MjModel, geom: int) -> tuple[Real, Integers] | None:
    """Return vertices and triangles in the frame of the geom, or None for other kinds."""
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
        return simplify_mesh(points, model.mesh_face[start : start + number].astype(np.intp))
    return None


def simplify_mesh(
    points: Real, triangles: Integers, limit: int = _MAX_TRIANGLES
) -> tuple[Real, Integers]:
    """Return a surface with at most so many triangles, by clustering of vertices.

    Vertices in one cell of a cubic grid become their mean (Rossignac and Borrel 1993). The grid is
    made coarser until few enough triangles keep three corners.

    Args:
        points: [m]; (n, 3).
        triangles: corners; (m, 3).
        limit: largest number of triangles.
    """
    cells = 256.0
    vertices, corners = points, triangles
    while len(corners) > limit:
        low, edge = points.min(axis=0), np.ptp(points, axis=0).max() / cells
        _, cell = np.unique(np.floor((points - low) / edge), axis=0, return_inverse=True)
        cell = cell.ravel()
        count = np.bincount(cell)
        vertices = np.stack([np.bincount(cell, axis) / count for axis in points.T], axis=1)
        corners = cell[triangles]
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        cells /= 1.4
    return vertices, corners


def sharp_edges(points: Real, triangles: Integers) -> Integers:
    """Return edges where two triangles meet at more than 30 degrees, or that bound only one.

    If no edge is sharp, as of a ball, the edges in the planes of the coordinates are returned; if
    there are none, all edges.

    Args:
        points [m] (n, 3), triangles (m, 3): as for ``simplify_mesh``.

    Returns:
        Numbers of their ends; (n_edge, 2).
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(triangles)), 3)
    order = np.lexsort(sides.T)
    sides, owner = sides[order], owner[order]
    edges, first, count = np.unique(sides, axis=0, return_index=True, return_counts=True)
    sharp = count != 2
    pairs = first[count == 2]
    sharp[count == 2] = (normal[owner[pairs]] * normal[owner[pairs + 1]]).sum(
        axis=1
    ) < _COS_SHARP_ANGLE
    if not sharp.any():
        flat = np.abs(points) <= 1e-9 * np.abs(points).max(initial=0.0)
        sharp = (flat[edges[:, 0]] & flat[edges[:, 1]]).any(axis=1)
    return edges[sharp] if sharp.any() else edges


def _boxes(machine: Machine, stages: tuple[str, ...]) -> list[Surface]:
    """Return small cubes at centres of mass, so that stages without geoms are visible."""
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


def _lines(
    model: mujoco.MjModel, data: mujoco.MjData, stage_names: list[str | None]
) -> list[TendonLine]:
    """Return the visible branches of spatial tendons."""
    lines = []
    for tendon in range(model.ntendon):
        if is_fixed_tendon(model, tendon) or model.tendon_group[tendon] >= _SHOWN_GROUPS:
            continue
        red, green, blue, opacity = np.round(model.tendon_rgba[tendon].astype(float), 4).tolist()
        colour = (red, green, blue, opacity)
        for _, points, bodies in tendon_branches(model, data, tendon):
            lines.append(
                TendonLine(
                    model.tendon(tendon).name or f"tendon{tendon}",
                    np.array(points),
                    tuple(stage_names[body] for body in bodies),
                    None if colour == _DEFAULT_COLOUR else colour,
                )
            )
    return lines
