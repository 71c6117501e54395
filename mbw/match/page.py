"""The page of ``mbw match``: simulated shapes in motion, frequencies paired, ratios."""

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import Complex, Dof, Real
from mbw.match.result import Result
from mbw.match.schema import MatchFile
from mbw.page.html import fill, packed, packed_complex, packed_integers, packed_sizes

_MOST = 40_000  # triangles; of more, every so manyth is drawn


def render(result: Result) -> str:
    """The HTML of a match."""
    summary = result.summary
    return fill(
        "match/template.html",
        _data(result),
        title=escape(f"{Path(summary.campaign).parent.name}: measured and simulated modes"),
        subtitle=escape(
            f"{len(summary.channels)} channels, {len(summary.impacts)} impacts, "
            f"{summary.lines} lines {summary.band[0]:g}..{summary.band[1]:g} Hz; "
            f"shapes of {Path(summary.shapes).name}"
        ),
        lead=escape(lead(summary)),
        alike=escape(_alike(summary)),
        scripts=["page/picture.js", "page/modes.js", "match/page.js"],
    )


def lead(summary: MatchFile) -> str:
    """What was found, in a sentence or two."""
    matched = [row for row in summary.modes if row.simulated is not None]
    words = [f"{len(matched)} of {len(summary.modes)} measured modes are simulated ones"]
    if matched:
        sure = min(row.probability for row in matched)
        words[0] += f", the least sure with a probability of {sure:.3g}"
        off = [row.frequency / row.simulated_frequency - 1 for row in matched]  # type: ignore[operator]
        words.append(
            f"Measured frequencies are {100 * min(off):+.1f} to {100 * max(off):+.1f} % off the "
            "simulated ones"
        )
    if summary.unmatched:
        left = ", ".join(map(str, summary.unmatched))
        words.append(f"Simulated in the band and not measured: {left}")
    if summary.unseen:
        unseen = ", ".join(map(str, summary.unseen))
        words.append(f"These channels do not see simulated mode {unseen}")
    if summary.mass is not None:
        words.append(f"The simulated structure weighs {summary.mass:.4g} kg by its rigid modes")
    return ". ".join(words) + "."


def _alike(summary: MatchFile) -> str:
    if not summary.alike:
        return "No two simulated modes in the band are alike at these channels (MAC above 0.8)."
    pairs = "; ".join(
        f"{one} and {other}, which {', '.join(channels)} tell best"
        for (one, other), channels in zip(summary.alike, summary.alike_told_by, strict=True)
    )
    return f"Alike at these channels (MAC above 0.8): {pairs}."


def _data(result: Result) -> dict[str, object]:
    summary, arrays = result.summary, result.arrays
    shown = arrays["shown"].tolist()
    column = {int(number): k for k, number in enumerate(arrays["numbers"])}
    own = [column[number] for number in shown]
    rows = [_row(row.model_dump(), shown) for row in summary.modes]
    rows += [
        {"simulated": number, "simulated_frequency": float(arrays["shown_hz"][shown.index(number)])}
        | {"at": shown.index(number), "frequency": None}
        for number in summary.unmatched
    ]
    return {
        "picture": _picture(result, rows),
        "modes": rows,
        "measured": len(summary.modes),
        "channels": summary.channels,
        "impacts": [Path(one).stem for one in summary.impacts],
        "reference": summary.reference,
        "band": summary.band,
        "shown": shown,
        "shown_hz": arrays["shown_hz"].tolist(),
        "places": arrays["places"].tolist(),
        "freq": packed(arrays["freq_hz"]),
        "amplitude": packed_sizes(arrays["amplitude"].transpose(1, 2, 0)),
        "ratios": packed(arrays["ratios"]),
        "closeness": packed_sizes(arrays["closeness"].transpose(1, 2, 0)),
        "closeness_largest": packed_sizes(arrays["closeness_largest"].transpose(1, 2, 0)),
        "probability": packed(arrays["probability"][:, own]),
        "mac": packed(arrays["mac"][:, own]),
    }


def _row(row: dict[str, Any], shown: list[int]) -> dict[str, object]:
    kept = {name: value for name, value in row.items() if name != "shape"}
    return kept | {"at": None if row["simulated"] is None else shown.index(row["simulated"])}


def _picture(result: Result, rows: list[dict[str, Any]]) -> dict[str, object]:
    """Surface and sensors, row after row; shapes of both of one size where the channels are."""
    summary, arrays = result.summary, result.arrays
    dofs = [Dof.parse(label) for label in summary.channels]
    points = list(dict.fromkeys(dof.point for dof in dofs))
    places = [arrays["channel_places"][[d.point for d in dofs].index(point)] for point in points]
    count = len(arrays["points"])
    surface = np.zeros((len(rows), count, 3), np.float32)
    sensors = np.zeros((len(rows), len(points), 3), complex)
    for number, row in enumerate(rows):
        measured = np.array(summary.modes[number].shape) if row["frequency"] is not None else None
        size = 1.0
        if row["at"] is not None:
            surface[number] = arrays["vectors"][row["at"]]
            simulated = arrays["at"][list(arrays["numbers"]).index(row["simulated"])]
            if measured is not None:
                size = float(simulated @ measured)
        if measured is not None:
            sensors[number] = _at_places(size * measured, arrays["channel_axes"], dofs, points)
    every = max(1, -(-len(arrays["triangles"]) // _MOST))
    return {
        "stages": [],
        "centres": "",
        "meshes": [],
        "points": [],
        "lines": [],
        "shapes": "",
        "boxed": [],
        "sensors": {
            "names": points,
            "places": packed(np.array(places)),
            "vectors": packed_complex(sensors),
        },
        "surface": {
            "points": packed(arrays["points"]),
            "triangles": packed_integers(arrays["triangles"][::every]),
            "vectors": packed(surface),
        },
    }


def _at_places(shape: Real, axes: Real, dofs: list[Dof], points: list[str]) -> Complex:
    """What the channels of each point read, as a vector; (n_point, 3)."""
    found = np.zeros((len(points), 3), complex)
    for value, axis, dof in zip(shape, axes, dofs, strict=True):
        found[points.index(dof.point)] += value * axis
    return found
