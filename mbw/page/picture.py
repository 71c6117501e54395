"""Surfaces, points and mode shapes of a machine, packed for the 3-D picture of a page."""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex, Integers, Layout, group_by_key, is_hammer_point
from mbmodel.geometry.surfaces import Colour, MachineGeometry, Surface
from mbw.page.html import pack_complex, pack_integers, pack_real
from mbw.site_kinds import sensor_sites

_BODY_COLOURS = (
    "#4c78a8", "#e0a13c", "#59a14f", "#b07aa1", "#76b7b2", "#d3705c",
    "#9c755f", "#8d99ae", "#c9a66b", "#6a8d73",
)  # fmt: skip
_WORLD_COLOUR = "#9aa1ab"


def picture_data(layout: Layout, geometry: MachineGeometry, shapes: Complex) -> dict[str, object]:
    """Return the data of the 3-D picture; vertices in metres, bodies by index, -1 for the world.

    Args:
        shapes: motion of the centres of mass, mode after mode; (n_mode, 6 n_body).
    """
    return {
        "stages": list(layout.bodies),
        "centres": pack_real(layout.centres),
        "meshes": _meshes(geometry, layout.bodies),
        "points": _points(layout),
        "lines": [
            {
                "name": line.name,
                "points": pack_real(line.points),
                "stages": [_body_index(stage, layout.bodies) for stage in line.stages],
                "colour": _hex(line.colour) if line.colour else "#3b414b",
            }
            for line in geometry.lines
        ],
        "shapes": pack_complex(shapes),
        "boxed": list(geometry.boxed),
    }


def _points(layout: Layout) -> list[dict[str, object]]:
    accelerometers = set(sensor_sites(layout))
    return [
        {
            "name": name,
            "stage": int(layout.body_of[k]),
            "place": layout.positions[k].tolist(),
            "kind": "hammer"
            if is_hammer_point(name)
            else ("sensor" if name in accelerometers else "site"),
        }
        for k, name in enumerate(layout.points)
    ]


def _meshes(geometry: MachineGeometry, bodies: Sequence[str]) -> list[dict[str, object]]:
    """Return one mesh for each body and colour."""
    palette = _palette(geometry, bodies)
    groups: dict[tuple[str | None, str, float], list[Surface]] = {}
    for surface in geometry.surfaces:
        opacity = surface.colour[3] if surface.colour else 1.0
        file_colour = _hex(surface.colour) if surface.colour else _WORLD_COLOUR
        key = (surface.stage, palette.get(surface.stage, file_colour), opacity)
        groups.setdefault(key, []).append(surface)
    return [
        {
            "stage": _body_index(stage, bodies),
            "colour": colour,
            "opacity": opacity,
            "vertices": pack_real(np.vstack([surface.vertices for surface in surfaces])),
            "triangles": pack_integers(_stack_indices(surfaces, "triangles")),
            "edges": pack_integers(_stack_indices(surfaces, "edges")),
        }
        for (stage, colour, opacity), surfaces in groups.items()
    ]


def _palette(geometry: MachineGeometry, bodies: Sequence[str]) -> dict[str | None, str]:
    """Return colours for bodies without colours in the MJCF, or with those of another body."""
    coloured = group_by_key((each.stage, each.colour) for each in geometry.surfaces)
    file_colours = {stage: set(colours) for stage, colours in coloured.items() if stage is not None}
    schemes = list(file_colours.values())
    return {
        stage: _BODY_COLOURS[bodies.index(stage) % len(_BODY_COLOURS)]
        for stage, colours in file_colours.items()
        if stage is not None and (colours == {None} or schemes.count(colours) > 1)
    }


def body_colours(bodies: Sequence[str]) -> dict[str | None, str]:
    """Return a colour for each body, and that of the world for None."""
    colours: dict[str | None, str] = {None: _WORLD_COLOUR}
    for number, name in enumerate(bodies):
        colours[name] = _BODY_COLOURS[number % len(_BODY_COLOURS)]
    return colours


def _stack_indices(surfaces: Sequence[Surface], name: str) -> Integers:
    """Return the triangles or edges of several surfaces as indices of their joint vertices."""
    parts, first = [], 0
    for surface in surfaces:
        parts.append(getattr(surface, name) + first)
        first += len(surface.vertices)
    return np.vstack(parts)


def _body_index(stage: str | None, bodies: Sequence[str]) -> int:
    return -1 if stage is None else bodies.index(stage)


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{round(255 * min(max(part, 0.0), 1.0)):02x}" for part in colour[:3])
