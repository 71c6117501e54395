"""Pages of a blind test: rates, reliability and all cases; smallest sizes on the machine."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import Layout, group_by_key
from identification.words.file_access import read_bytes
from mbmodel.geometry.surfaces import MachineGeometry
from mbw.blind.case import REQUEST_JSON
from mbw.output_folder import source_of
from mbw.page.html import fill_template, read_fragment, warning_boxes
from mbw.page.picture import picture_data
from mbw.results.diagnosed_files import list_linked

GRADES, TABLES, PAGE = "grades.json", "grades.txt", "blind.html"


def render(
    grades: Mapping[str, Any], tables: str, title: str, failed: list[str], drawn: str = ""
) -> str:
    """Return the HTML page of a blind test.

    Args:
        grades: content of grades.json.
        tables: content of grades.txt.
        failed: sentences on cases that could not be run.
        drawn: sentences on what was drawn.
    """
    both = grades["verdicts"]["all"]["rates"]["both"] if grades["verdicts"] else None
    lead = f"The diagnosis was scored on {len(grades['lines'])} campaigns with withheld answers."
    if both is not None and both["n"]:
        lead += (
            f" Effect and place were right in {both['hits']:g} of {both['n']} cases (95 % interval "
            f"{both['low']:.0%} to {both['high']:.0%})."
        )
    reasons = [f"case {name}: {reason}" for name, reason in grades["failed"].items()]
    return fill_template(
        "blind/template.html",
        {**grades, "tables": tables},
        scripts=["blind/page.js"],
        title=escape(f"Blind test: {title}"),
        subtitle="the hash of each answer was published before the verdict",
        lead=escape(f"{lead} {drawn}".rstrip()),
        warnings=warning_boxes([*failed, *reasons]),
    )


def render_folder(path: Path) -> str:
    """Return the page of a blind test's folder, or of its grades.json.

    Raises:
        InputError: the grades are missing or no text.
        Exception: of many types: the grades were altered.
    """
    folder = path if path.is_dir() else path.parent
    source = source_of(folder, GRADES)
    title = folder.absolute().name.removesuffix("-blind") if source is None else source.stem
    remedy = "run mbw blind again"
    grades = json.loads(read_bytes(folder / GRADES, remedy))
    tables = read_bytes(folder / TABLES, remedy).decode("utf-8")
    return render(grades, tables, title, describe_failures(folder), describe_draws(folder))


def describe_draws(folder: Path) -> str:
    """Return sentences on seed, chosen effects, places and sizes, and small imperfections."""
    try:
        request = json.loads((folder / REQUEST_JSON).read_text("utf-8"))
        choice = request.get("choice") or {}
        words = [f"The seed is {request['seed']}."]
        if choice.get("effects"):
            places = " or ".join(choice["places"]) or "drawn places"
            size = "survival ratios " + (", ".join(f"{r:g}" for r in choice["ratios"]) or "1 to 8")
            if choice["parameter"]:
                size = "{} = {:g}".format(*choice["parameter"])
            words.append(f"Drawn: {', '.join(choice['effects'])} at {places}, {size}.")
        if choice.get("dirt"):
            words.append(
                f"Small imperfections leave {choice['dirt']:g} % of the motion of every machine."
            )
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return ""
    return " ".join(words)


def describe_failures(folder: Path) -> list[str]:
    """Return a sentence on each error with which cases ended."""
    cases = group_by_key(
        (_last_error(file.read_text("utf-8")), file.parent.name)
        for file in sorted(folder.glob("cases/*/failed.txt"))
    )
    return [
        f"case{'s' if len(names) > 1 else ''} {', '.join(names)} could not be run: {error}"
        for error, names in cases.items()
    ]


def _last_error(traceback: str) -> str:
    """Return the message of the error, after its type unless it is a sentence for the user."""
    lines = traceback.splitlines()
    stack = [number for number, line in enumerate(lines) if line.startswith("  ")]
    error = " ".join(" ".join(lines[stack[-1] + 1 if stack else 0 :]).split())
    return re.sub(r"^(truth\.errors|identification\.words\.errors)\.\w+: ", "", error)


_NEAR_ONE = 0.1  # a factor or gain: its difference from 1 is the effect


def size_text(value: float) -> str:
    """Return a size with three digits, and a factor near 1 with two of its difference from 1.

    ``sizeText`` in places_state.js does the same on pages.
    """
    off = abs(value - 1)
    if not 0 < off < _NEAR_ONE:
        return f"{value:.3g}"
    return f"{value:.{min(12, 1 - math.floor(math.log10(off)))}f}"


PLACES_SCRIPTS = ("blind/places_state.js", "page/picture.js", "blind/places.js")


def render_sizes(
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
