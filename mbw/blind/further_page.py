"""Page of further tests: their ranking, and where they act on the machine."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from identification.words import Layout
from mbmodel.geometry.surfaces import MachineGeometry
from mbw.blind.smallest_page import PLACES_SCRIPTS, find_points
from mbw.page.html import fill_template, read_fragment
from mbw.page.picture import picture_data


def render(
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    layout: Layout,
    geometry: MachineGeometry,
    title: str,
) -> str:
    """Return the HTML page.

    Args:
        rows: content of further.json.
        layout: bodies and points of the machine.
        geometry: its surfaces.
        title: name of the model.
    """
    gains = rows["gains"]
    no_shapes = np.zeros((0, 6 * len(layout.bodies)), complex)
    data = {
        "places": [_place(gain, layout) for gain in gains],
        "confirmed": list(rows["confirmed"]),
        "picture": picture_data(layout, geometry, no_shapes),
    }
    return fill_template(
        "blind/further.html",
        data,
        scripts=[*PLACES_SCRIPTS, "blind/further.js"],
        title=escape(f"What helps most: {title}"),
        subtitle="further hammer points, sensors, hits and forces, ranked by what they show",
        lead=escape(_describe_best(gains)),
        places=read_fragment("blind/further_picture.html"),
    )


def _describe_best(gains: Sequence[Mapping[str, Any]]) -> str:
    """Return a sentence on the most helpful further test."""
    best = gains[0]
    return (
        f"Of {len(gains)} further tests {best['name']} helps most: nine tests of ten find "
        f"{best['findable']} of {best['compared']} faults of usual size with it, and "
        f"{best['findable_before']} as it is; smallest sizes are {best['shrink']:.2g} of those as "
        "it is."
    )


def _place(gain: Mapping[str, Any], layout: Layout) -> dict[str, object]:
    """Return a further test with its points in the picture; none of more hits or force."""
    kind, _, site = str(gain["name"]).rpartition(" ")
    location = f"{'sensor' if kind == 'sensor' else 'hammer'}:{site}"
    bodies, points = find_points(location, layout) if site in layout.points else ([], [])
    return {"name": gain["name"], "bodies": bodies, "points": points, "gain": dict(gain)}
