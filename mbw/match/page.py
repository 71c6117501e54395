"""Page of ``mbw match``: animated simulated shapes, paired frequencies, ratios of amplitudes."""

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import Complex, Dof, Real
from mbw.match.circles import base_channel, pack_circles
from mbw.match.result import MatchResult
from mbw.match.schema import MatchFile
from mbw.page.html import (
    fill_template,
    pack_complex,
    pack_integers,
    pack_magnitudes,
    pack_real,
    warning_boxes,
)

_MAX_PICTURE_TRIANGLES = (
    40_000  # in the picture; of a larger mesh only every n-th triangle is drawn
)


def render(result: MatchResult) -> str:
    """Return the HTML page of a match."""
    summary = result.summary
    return fill_template(
        "match/template.html",
        _data(result),
        title=escape(f"{Path(summary.campaign).parent.name}: measured and simulated modes"),
        subtitle=escape(
            f"{len(summary.channels)} channels, {len(summary.impacts)} impacts, "
            f"{summary.lines} frequency lines {summary.band[0]:g}..{summary.band[1]:g} Hz; "
            f"shapes of {Path(summary.shapes).name}"
        ),
        lead=escape(lead(summary)),
        warnings=warning_boxes(_warnings(summary)),
        alike=escape(_similar_pairs(summary)),
        scripts=["page/picture.js", "page/modes.js", "match/circles.js", "match/page.js"],
    )


def lead(summary: MatchFile) -> str:
    """Return the result in a few sentences."""
    matched = [row for row in summary.modes if row.simulated is not None]
    sentences = [f"{len(matched)} of {len(summary.modes)} measured modes match a simulated mode"]
    if matched:
        lowest = min(row.probability for row in matched)
        sentences[0] += f"; the lowest probability of a match is {lowest:.3g}"
        off = [row.frequency / row.simulated_frequency - 1 for row in matched]  # type: ignore[operator]
        sentences.append(
            f"Measured frequencies are {100 * min(off):+.1f} to {100 * max(off):+.1f} % off the "
            "simulated ones"
        )
    if summary.unmatched:
        unmatched = ", ".join(map(str, summary.unmatched))
        sentences.append(f"Simulated modes in the band that were not measured: {unmatched}")
    if summary.unseen:
        unseen = ", ".join(map(str, summary.unseen))
        sentences.append(f"Simulated modes that do not move at these channels: {unseen}")
    if summary.mass_check is not None and summary.mass_check.agrees:
        sentences.append(summary.mass_check.remark)
    elif summary.mass is not None:
        sentences.append(f"The simulated structure weighs {summary.mass:.4g} kg by its rigid modes")
    return ". ".join(sentences) + "."


def _warnings(summary: MatchFile) -> list[str]:
    """Return the remarks that a reader must not miss."""
    check = summary.mass_check
    return [] if check is None or check.agrees else [f"{check.remark}."]


def _similar_pairs(summary: MatchFile) -> str:
    if not summary.alike:
        return "No two simulated modes in the band are similar at these channels (MAC above 0.8)."
    pairs = "; ".join(
        f"{first} and {second}, which differ most at {', '.join(channels)}"
        for (first, second), channels in zip(summary.alike, summary.alike_told_by, strict=True)
    )
    return f"Similar at these channels (MAC above 0.8): {pairs}."


def _data(result: MatchResult) -> dict[str, object]:
    summary, arrays = result.summary, result.arrays
    shown = arrays["shown"].tolist()
    column = {int(number): k for k, number in enumerate(arrays["numbers"])}
    columns = [column[number] for number in shown]
    rows = [_row(row.model_dump(), shown) | {"base": base_channel(row)} for row in summary.modes]
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
        "impacts": [Path(file).stem for file in summary.impacts],
        "reference": summary.reference,
        "band": summary.band,
        "shown": shown,
        "shown_hz": arrays["shown_hz"].tolist(),
        "places": arrays["places"].tolist(),
        "freq": pack_real(arrays["freq_hz"]),
        "amplitude": pack_magnitudes(arrays["amplitude"].transpose(1, 2, 0)),
        "ratios": pack_real(arrays["ratios"]),
        "closeness": pack_magnitudes(arrays["closeness"].transpose(1, 2, 0)),
        "closeness_largest": pack_magnitudes(arrays["closeness_largest"].transpose(1, 2, 0)),
        "probability": pack_real(arrays["probability"][:, columns]),
        "mac": pack_real(arrays["mac"][:, columns]),
        "circles": pack_circles(summary, arrays),
    }


def _row(row: dict[str, Any], shown: list[int]) -> dict[str, object]:
    kept = {name: value for name, value in row.items() if name != "shape"}
    return kept | {"at": None if row["simulated"] is None else shown.index(row["simulated"])}


def _picture(result: MatchResult, rows: list[dict[str, Any]]) -> dict[str, object]:
    """Return surface and sensors with their motion in each row of the table.

    Measured shapes have the scale that fits the simulated shape best at the channels.
    """
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
            sensors[number] = _point_vectors(size * measured, arrays["channel_axes"], dofs, points)
    every = max(1, -(-len(arrays["triangles"]) // _MAX_PICTURE_TRIANGLES))
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
            "places": pack_real(np.array(places)),
            "vectors": pack_complex(sensors),
        },
        "surface": {
            "points": pack_real(arrays["points"]),
            "triangles": pack_integers(arrays["triangles"][::every]),
            "vectors": pack_real(surface),
        },
    }


def _point_vectors(shape: Real, axes: Real, dofs: list[Dof], points: list[str]) -> Complex:
    """Return the readings of each point's channels as a vector; (n_point, 3)."""
    vectors = np.zeros((len(points), 3), complex)
    for value, axis, dof in zip(shape, axes, dofs, strict=True):
        vectors[points.index(dof.point)] += value * axis
    return vectors
