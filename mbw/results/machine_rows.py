"""Machine of a diagnosis as rows and arrays, from which the page can be drawn without the MJCF."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from identification.words import Layout
from mbmodel import WORLD, Machine, MachineGeometry
from mbmodel.geometry.surfaces import Surface, TendonLine
from mbw.results.diagnosed_schema import LineRow, MachineRow, MeshRow, PlaceRow

_SURFACE_ARRAYS = {"vertices": np.float32, "triangles": np.int32, "edges": np.int32}


def machine_rows(layout: Layout, geometry: MachineGeometry) -> tuple[MachineRow, dict[str, Any]]:
    """Return the names of a machine as a row, and its numbers as arrays by name.

    Args:
        layout: bodies and points.
        geometry: surfaces and lines.
    """
    row = MachineRow(
        bodies=list(layout.bodies),
        points=list(layout.points),
        body_of=layout.body_of.tolist(),
        surfaces=[
            MeshRow(
                stage=surface.stage,
                colour=surface.colour,
                **{name: len(getattr(surface, name)) for name in _SURFACE_ARRAYS},
            )
            for surface in geometry.surfaces
        ],
        lines=[
            LineRow(name=line.name, stages=list(line.stages), colour=line.colour)
            for line in geometry.lines
        ],
        boxed=list(geometry.boxed),
    )
    arrays: dict[str, Any] = {"centres": layout.centres, "positions": layout.positions}
    for name, kind in _SURFACE_ARRAYS.items():
        parts = [np.asarray(getattr(surface, name), kind) for surface in geometry.surfaces]
        width = 2 if name == "edges" else 3
        arrays[name] = np.concatenate([np.zeros((0, width), kind), *parts])
    points = [line.points for line in geometry.lines]
    arrays["line_points"] = np.concatenate([np.zeros((0, 3)), *points])
    return row, arrays


def restore_machine(row: MachineRow, arrays: Mapping[str, Any]) -> tuple[Layout, MachineGeometry]:
    """Restore layout and geometry of a machine from its row and arrays.

    Raises:
        ValueError: row and arrays contradict each other.
        KeyError: an array is missing.
    """
    count = len(row.points)
    layout = Layout(
        tuple(row.bodies),
        arrays["centres"],
        tuple(row.points),
        np.array(row.body_of, np.intp),
        arrays["positions"],
        np.broadcast_to(np.eye(3), (count, 3, 3)),
    )
    pieces = {
        name: _split_rows(arrays[name], [getattr(mesh, name) for mesh in row.surfaces])
        for name in _SURFACE_ARRAYS
    }
    surfaces = tuple(
        Surface(
            mesh.stage, **{name: next(parts) for name, parts in pieces.items()}, colour=mesh.colour
        )
        for mesh in row.surfaces
    )
    points = _split_rows(arrays["line_points"], [len(line.stages) for line in row.lines])
    lines = tuple(
        TendonLine(line.name, next(points), tuple(line.stages), line.colour) for line in row.lines
    )
    return layout, MachineGeometry(surfaces, lines, tuple(row.boxed))


def _split_rows(rows: Any, sizes: list[int]) -> Iterator[Any]:
    """Yield consecutive pieces of these sizes."""
    if len(rows) != sum(sizes):
        raise ValueError(f"{len(rows)} rows where {sum(sizes)} are named")
    return iter(np.split(rows, np.cumsum(sizes)[:-1]) if sizes else [])


def place_row(location: str, machine: Machine) -> PlaceRow:
    """Return bodies and points of a location of the verdict.

    Args:
        location: location such as ``joint:ty``.
        machine: machine with its axles.
    """
    layout = machine.layout
    kind, _, name = location.partition(":")
    if kind == "joint":
        anchors = [axle.anchor for axle in machine.axles if axle.stage == name]
        return _place([name], [np.mean(anchors, axis=0)] if anchors else [])
    if kind == "pair":
        bodies = list_linked(name, layout.bodies)
        ends = [layout.centres[layout.bodies.index(body)] for body in bodies]
        row = _place(bodies, [np.mean(ends, axis=0)] if ends else [])
        line = _place(bodies, ends).points if len(ends) > 1 else []  # no line ends at the ground
        return row.model_copy(update={"line": line})
    if kind == "body":
        bodies = [name] if name in layout.bodies else []
        return _place(bodies, [layout.centres[layout.bodies.index(body)] for body in bodies])
    sites = [site for site in name.split("+") if site in layout.points]
    places = [layout.positions[layout.points.index(site)] for site in sites]
    return _place([layout.body_name(site) for site in sites], places)


def _place(bodies: list[str], points: list[Any]) -> PlaceRow:
    return PlaceRow(
        bodies=list(dict.fromkeys(bodies)),
        points=[(float(x), float(y), float(z)) for x, y, z in points],
    )


def list_linked(name: str, bodies: Sequence[str]) -> list[str]:
    """Return the bodies of ``lower-upper``, whose names may contain hyphens themselves.

    Args:
        name: of the pair; the lower one may be the ground, ``world``, which is not returned.
        bodies: all bodies.
    """
    pairs = (
        [lower, upper]
        for lower in (*bodies, WORLD)
        for upper in bodies
        if name == f"{lower}-{upper}"
    )
    return [body for body in next(pairs, []) if body in bodies]
