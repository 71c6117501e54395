"""A machine's surfaces, points and mode shapes as numbers for a page's 3-D picture."""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex, Integers, Layout, is_hammer
from mbmodel.geometry.surfaces import Colour, Looks, Surface
from mbw.page.html import packed, packed_complex, packed_integers
from mbw.site_kinds import sensors

_PALETTE = (
    "#4c78a8", "#e0a13c", "#59a14f", "#b07aa1", "#76b7b2", "#d3705c",
    "#9c755f", "#8d99ae", "#c9a66b", "#6a8d73",
)  # fmt: skip
_WORLD = "#9aa1ab"


def picture(layout: Layout, looks: Looks, shapes: Complex) -> dict[str, object]:
    """All that the 3-D picture needs; vertices in metres, stages by number, -1 the world.

    Args:
        layout: bodies and points.
        looks: surfaces and lines.
        shapes: motion of each centre of mass, mode after mode; (n_mode, 6 n_body).
    """
    return {
        "stages": list(layout.bodies),
        "centres": packed(layout.centres),
        "meshes": _meshes(looks, layout.bodies),
        "points": _points(layout),
        "lines": [
            {
                "name": line.name,
                "points": packed(line.points),
                "stages": [_number(stage, layout.bodies) for stage in line.stages],
                "colour": _hex(line.colour) if line.colour else "#3b414b",
            }
            for line in looks.lines
        ],
        "shapes": packed_complex(shapes),
        "boxed": list(looks.boxed),
    }


def _points(layout: Layout) -> list[dict[str, object]]:
    accelerometers = set(sensors(layout))
    return [
        {
            "name": name,
            "stage": int(layout.body_of[k]),
            "place": layout.positions[k].tolist(),
            "kind": "hammer"
            if is_hammer(name)
            else ("sensor" if name in accelerometers else "site"),
        }
        for k, name in enumerate(layout.points)
    ]


def _meshes(looks: Looks, bodies: Sequence[str]) -> list[dict[str, object]]:
    """One mesh for each stage and colour."""
    palette = _palette(looks, bodies)
    groups: dict[tuple[str | None, str, float], list[Surface]] = {}
    for surface in looks.surfaces:
        opacity = surface.colour[3] if surface.colour else 1.0
        given = _hex(surface.colour) if surface.colour else _WORLD
        key = (surface.stage, palette.get(surface.stage, given), opacity)
        groups.setdefault(key, []).append(surface)
    return [
        {
            "stage": _number(stage, bodies),
            "colour": colour,
            "opacity": opacity,
            "vertices": packed(np.vstack([surface.vertices for surface in surfaces])),
            "triangles": packed_integers(_joined(surfaces, "triangles")),
            "edges": packed_integers(_joined(surfaces, "edges")),
        }
        for (stage, colour, opacity), surfaces in groups.items()
    ]


def _palette(looks: Looks, bodies: Sequence[str]) -> dict[str | None, str]:
    """Colours for stages that the MJCF leaves plain or colours like another."""
    given: dict[str | None, set[Colour | None]] = {}
    for surface in looks.surfaces:
        if surface.stage is not None:
            given.setdefault(surface.stage, set()).add(surface.colour)
    schemes = list(given.values())
    return {
        stage: _PALETTE[bodies.index(stage) % len(_PALETTE)]
        for stage, colours in given.items()
        if stage is not None and (colours == {None} or schemes.count(colours) > 1)
    }


def _joined(surfaces: Sequence[Surface], name: str) -> Integers:
    """Triangles or edges of several surfaces, numbered through."""
    parts, first = [], 0
    for surface in surfaces:
        parts.append(getattr(surface, name) + first)
        first += len(surface.vertices)
    return np.vstack(parts)


def _number(stage: str | None, bodies: Sequence[str]) -> int:
    return -1 if stage is None else bodies.index(stage)


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{round(255 * min(max(part, 0.0), 1.0)):02x}" for part in colour[:3])
