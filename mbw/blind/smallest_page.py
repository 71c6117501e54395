"""Page of predicted smallest sizes: places on the machine, and what the test shows at each."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from identification.words import Layout
from mbmodel.geometry.surfaces import MachineGeometry
from mbw.page.html import fill_template, read_fragment
from mbw.page.picture import picture_data
from mbw.results.diagnosed_files import list_linked

PLACES_SCRIPTS = ("blind/places_state.js", "page/picture.js", "blind/places.js")


def render(
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    layout: Layout,
    geometry: MachineGeometry,
    title: str,
) -> str:
    """Return the HTML page.

    Args:
        rows: content of smallest.json.
    """
    sizes = rows["sizes"]
    missed = sum(not row["is_found"] for row in sizes)
    lead = (
        f"{len(sizes)} effects at their places were compared by what the test tells of them. "
        f"{len(sizes) - missed} of them are found at a plausible size in nine tests of ten."
    )
    no_shapes = np.zeros((0, 6 * len(layout.bodies)), complex)
    data = {
        "places": _places(sizes, layout),
        "confirmed": list(rows["confirmed"]),
        "picture": picture_data(layout, geometry, no_shapes),
    }
    return fill_template(
        "blind/smallest.html",
        data,
        scripts=[*PLACES_SCRIPTS, "blind/smallest.js"],
        title=escape(f"What the test shows: {title}"),
        subtitle="smallest sizes that nine tests of ten find, predicted",
        lead=escape(lead),
        places=read_fragment("blind/smallest_picture.html"),
    )


def _places(sizes: Sequence[Mapping[str, Any]], layout: Layout) -> list[dict[str, object]]:
    """Return the places with their points in the picture, and the rows of their effects."""
    places: dict[str, dict[str, object]] = {}
    for location in dict.fromkeys(str(row["location"]) for row in sizes):
        bodies, points = find_points(location, layout)
        effects = [dict(row) for row in sizes if row["location"] == location]
        effects.sort(key=lambda row: (row["is_found"], -(row["of_usual"] or 0.0)))
        places[location] = {
            "name": location,
            "bodies": bodies,
            "points": points,
            "line": points if len(points) > 1 else [],
            "missed": sum(not row["is_found"] for row in effects),
            "rows": effects,
        }
    return sorted(places.values(), key=lambda place: -int(str(place["missed"])))


def find_points(location: str, layout: Layout) -> tuple[list[str], list[list[float]]]:
    """Return the bodies of a location and its points [m].

    Args:
        location: as in an answer.
    """
    kind, _, name = location.partition(":")
    if kind == "pair":
        names = list_linked(name, layout.bodies)
    elif kind in ("body", "joint"):
        names = [name] if name in layout.bodies else []
    else:
        sites = [site for site in name.split("+") if site in layout.points]
        numbers = [layout.points.index(site) for site in sites]
        bodies = [layout.bodies[int(layout.body_of[k])] for k in numbers]
        return list(dict.fromkeys(bodies)), layout.positions[numbers].tolist()
    return names, layout.centres[[layout.bodies.index(body) for body in names]].tolist()
