"""The machine of a diagnosis as rows and arrays, so that its page can be drawn without the MJCF."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from identification.words import Layout
from mbmodel import Looks, Machine
from mbmodel.geometry.surfaces import Line, Surface
from mbw.diagnose.schema import LineRow, MachineRow, MeshRow, PlaceRow

_KINDS = {"vertices": np.float32, "triangles": np.int32, "edges": np.int32}


def machine_rows(layout: Layout, looks: Looks) -> tuple[MachineRow, dict[str, Any]]:
    """A machine's names, and its numbers by name.

    Args:
        layout: bodies and points.
        looks: surfaces and lines.
    """
    row = MachineRow(
        bodies=list(layout.bodies),
        points=list(layout.points),
        body_of=layout.body_of.tolist(),
        surfaces=[
            MeshRow(
                stage=one.stage,
                colour=one.colour,
                **{name: len(getattr(one, name)) for name in _KINDS},
            )
            for one in looks.surfaces
        ],
        lines=[
            LineRow(name=one.name, stages=list(one.stages), colour=one.colour)
            for one in looks.lines
        ],
        boxed=list(looks.boxed),
    )
    arrays: dict[str, Any] = {"centres": layout.centres, "positions": layout.positions}
    for name, kind in _KINDS.items():
        parts = [np.asarray(getattr(one, name), kind) for one in looks.surfaces]
        width = 2 if name == "edges" else 3
        arrays[name] = np.concatenate([np.zeros((0, width), kind), *parts])
    points = [one.points for one in looks.lines]
    arrays["line_points"] = np.concatenate([np.zeros((0, 3)), *points])
    return row, arrays


def machine_of(row: MachineRow, arrays: Mapping[str, Any]) -> tuple[Layout, Looks]:
    """The same back from rows and arrays.

    Raises:
        ValueError: rows and arrays that contradict each other.
        KeyError: an array that is missing.
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
    cut = {
        name: _cut(arrays[name], [getattr(one, name) for one in row.surfaces]) for name in _KINDS
    }
    surfaces = tuple(
        Surface(one.stage, **{name: next(parts) for name, parts in cut.items()}, colour=one.colour)
        for one in row.surfaces
    )
    points = _cut(arrays["line_points"], [len(one.stages) for one in row.lines])
    lines = tuple(Line(one.name, next(points), tuple(one.stages), one.colour) for one in row.lines)
    return layout, Looks(surfaces, lines, tuple(row.boxed))


def _cut(rows: Any, sizes: list[int]) -> Iterator[Any]:
    """Pieces of these sizes, one after the other."""
    if len(rows) != sum(sizes):
        raise ValueError(f"{len(rows)} rows where {sum(sizes)} are named")
    return iter(np.split(rows, np.cumsum(sizes)[:-1]) if sizes else [])


def place_row(location: str, machine: Machine) -> PlaceRow:
    """Where a location of the verdict is.

    Args:
        location: such as ``joint:ty``.
        machine: with its axles.
    """
    layout = machine.layout
    kind, _, name = location.partition(":")
    if kind == "joint":
        anchors = [axle.anchor for axle in machine.axles if axle.stage == name]
        return _place([name], [np.mean(anchors, axis=0)] if anchors else [])
    if kind == "pair":
        bodies = _pair(name, layout.bodies)
        middle = [layout.centres[layout.bodies.index(body)] for body in bodies]
        return _place(bodies, [np.mean(middle, axis=0)] if middle else [])
    if kind == "body":
        known = [name] if name in layout.bodies else []
        return _place(known, [layout.centres[layout.bodies.index(body)] for body in known])
    sites = [site for site in name.split("+") if site in layout.points]
    places = [layout.positions[layout.points.index(site)] for site in sites]
    return _place([layout.body_name(site) for site in sites], places)


def _place(bodies: list[str], points: list[Any]) -> PlaceRow:
    return PlaceRow(
        bodies=list(dict.fromkeys(bodies)),
        points=[(float(x), float(y), float(z)) for x, y, z in points],
    )


def _pair(name: str, bodies: tuple[str, ...]) -> list[str]:
    """Both bodies of ``lower-upper``, whose names may hold hyphens themselves."""
    found = [(one, other) for one in bodies for other in bodies if name == f"{one}-{other}"]
    return list(found[0]) if found else []
