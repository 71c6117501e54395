"""``mbw place``: sensor placement by effective independence, and assessment of a layout."""

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from identification.matching import shapes_at_channels
from identification.readers.layout import SITES_HEADER, read_layout, read_sites, sites_layout
from identification.readers.result_files import FORMAT
from identification.shapes import (
    Shapes,
    antinodes,
    distinguish_modes,
    effective_independence,
    read_shapes,
    rigid_modes,
)
from identification.words import Dof, InputError, Integers, Layout
from identification.words.csv_cells import write_csv
from mbw.files import write_json
from mbw.match.verb import SimulatedShapes
from mbw.messages import SCREEN
from mbw.output_folder import OutputRequest, ResultOptions, open_output_folder

SITES_TABLE = "sites.csv"
_MIN_CANDIDATE_DISTANCE = 0.05  # between candidate places, over the diagonal of the mesh
_MAX_PAIR_CHANNELS = 3  # channels that are listed for a confused pair
_MIN_MODE_MOTION = 0.1  # at all channels, over the largest motion; below, a mode is weak there


@dataclass(frozen=True)
class PlacementRequest:
    """Request for places of sensors.

    Args:
        channels: number of channels; None for three for each mode.
        band: band of the modes to distinguish [Hz]; None for all elastic modes.
        apart: least distance of two places [m]; None for 5 % of the mesh's diagonal.
    """

    channels: int | None
    band: tuple[float, float] | None
    apart: float | None


def run(
    simulated: SimulatedShapes,
    request: PlacementRequest,
    check: Path | None,
    outputs: ResultOptions,
) -> None:
    """Propose places and directions, or assess given ones; print which modes they confuse.

    Args:
        request: request for places.
        check: table of sites, or layout, to assess instead; None for a proposal.
        outputs: where the table is written: a folder, a .csv file, or stdout for None.

    Raises:
        InputError: a file cannot be used, or no elastic mode lies in the band.
        UsageError: there are too few channels for the modes.
    """
    every_shape = read_shapes(simulated.shapes, simulated.frequencies)
    for remark in every_shape.remarks:
        SCREEN.say(remark)
    frequencies = every_shape.frequencies
    is_elastic = rigid_modes(every_shape).supported
    low, high = request.band or (0.0, np.inf)
    chosen = np.flatnonzero(is_elastic & (frequencies >= low) & (frequencies <= high))
    if not len(chosen):
        raise InputError(
            f"{every_shape.source} has no mode between {low:g} and {high:g} Hz: widen --band"
        )
    shapes = every_shape.select(chosen)
    if check is not None:
        layout, dofs = _read_channels(check)
    else:
        layout, dofs = propose_channels(shapes, request)
        _write_table(format_sites_table(layout, dofs), simulated.shapes, outputs)
    for remark in layout.remarks:
        SCREEN.say(remark)
    assessment = _assess(shapes, shapes.numbers, layout, dofs)
    if outputs.json is not None:
        write_json(
            json.dumps({"format": FORMAT, **assessment}, indent=1, allow_nan=False), outputs.json
        )
    _say(assessment)


def _write_table(text: str, source: Path, outputs: ResultOptions) -> None:
    """Write the table to its file, or to stdout unless that holds the JSON."""
    out = outputs.out
    if out is None:
        if not outputs.has_json_on_stdout:
            typer.echo(text, nl=False)
        return
    target = out if out.suffix == ".csv" else out / SITES_TABLE
    request = OutputRequest("place", source, target.parent, (target.name,), outputs.overwrite)
    with open_output_folder(request) as output, output.write() as place:
        (place / target.name).write_text(text, encoding="utf-8")
    SCREEN.say(f"places in {target}")


def propose_channels(shapes: Shapes, request: PlacementRequest) -> tuple[Layout, tuple[Dof, ...]]:
    """Choose channels by effective independence (Kammer 1991).

    The candidates keep a distance from each other; the antinodes are among them.
    """
    count = request.channels or 3 * len(shapes)
    distance = _MIN_CANDIDATE_DISTANCE * shapes.extent if request.apart is None else request.apart
    places = _candidates(shapes, distance)
    at_places = shapes.vectors[:, places]  # (n_mode, n_place, 3)
    kept = effective_independence(at_places.reshape(len(shapes), -1), count)
    points, axes = places[kept // 3], kept % 3
    order = list(dict.fromkeys(points.tolist()))
    layout = sites_layout([f"acc{k + 1}" for k in range(len(order))], shapes.points[order])
    dofs = tuple(
        Dof.of(layout.points[order.index(point)], axis)
        for point, axis in zip(points.tolist(), axes.tolist(), strict=True)
    )
    return layout, dofs


def _candidates(shapes: Shapes, distance: float) -> Integers:
    """Return points at a distance from each other: antinodes first, then in the mesh's order."""
    used = np.unique(shapes.triangles)
    best = antinodes(shapes.vectors[:, used])
    order = used[np.append(best, np.setdiff1d(np.arange(len(used)), best))]
    is_free = np.ones(len(order), bool)
    chosen = []
    for k, point in enumerate(order.tolist()):
        if is_free[k]:
            chosen.append(point)
            away = np.linalg.norm(shapes.points[order] - shapes.points[point], axis=1)
            is_free &= away >= distance
    return np.array(chosen, np.intp)


def format_sites_table(layout: Layout, dofs: Sequence[Dof]) -> str:
    """Return a table of sites, places [m] and axes as CSV."""
    text = io.StringIO()
    rows: list[Sequence[object]] = [SITES_HEADER]
    for site, place in zip(layout.points, layout.positions, strict=True):
        axes = "".join(sorted(dof.direction[-1] for dof in dofs if dof.point == site))
        rows.append([site, *(f"{x:.6g}" for x in place), axes])
    write_csv(text, rows)
    return text.getvalue()


def _read_channels(path: Path) -> tuple[Layout, tuple[Dof, ...]]:
    """Read a table of sites with its axes, or a layout with three axes at every site."""
    if path.suffix == ".csv":
        return read_sites(path)
    layout = read_layout(path)
    return layout, tuple(Dof.of(site, axis) for site in layout.points for axis in range(3))


def _assess(
    shapes: Shapes, numbers: Integers, layout: Layout, dofs: Sequence[Dof]
) -> dict[str, Any]:
    """Return the channels, the modes, and the pairs of modes that the channels confuse."""
    at_channels = shapes_at_channels(shapes, layout, dofs)
    similarity = distinguish_modes(at_channels)
    off_diagonal = similarity.mac - np.eye(len(at_channels))
    first, second = divmod(int(off_diagonal.argmax()), len(off_diagonal))
    largest = np.linalg.norm(shapes.vectors, axis=2).max(axis=1)
    motion = np.linalg.norm(at_channels, axis=1) / largest
    return {
        "channels": [str(dof) for dof in dofs],
        "sites": {
            site: [float(x) for x in place]
            for site, place in zip(layout.points, layout.positions, strict=True)
        },
        "modes": [
            {"mode": int(number), "frequency": float(frequency), "motion": float(size)}
            for number, frequency, size in zip(numbers, shapes.frequencies, motion, strict=True)
        ],
        "most_similar": {
            "modes": [int(numbers[first]), int(numbers[second])],
            "mac": float(off_diagonal[first, second]),
        }
        if len(at_channels) > 1
        else None,
        "confused": [
            {
                "modes": [int(numbers[first]), int(numbers[second])],
                "differ_most_at": [str(dofs[k]) for k in channels[:_MAX_PAIR_CHANNELS]],
            }
            for (first, second), channels in zip(
                similarity.confused, similarity.channels, strict=True
            )
        ],
    }


def _say(assessment: dict[str, Any]) -> None:
    """Print which modes the channels confuse, and which pair is most similar."""
    modes = ", ".join(f"{row['mode']} ({row['frequency']:.2f} Hz)" for row in assessment["modes"])
    channels, sites = len(assessment["channels"]), len(assessment["sites"])
    SCREEN.say(f"{channels} channels at {sites} sites for the modes {modes}")
    if similar := assessment["most_similar"]:
        first, second = similar["modes"]
        SCREEN.say(
            f"most similar at these channels: modes {first} and {second}, MAC {similar['mac']:.2f}"
        )
    for row in assessment["confused"]:
        (first, second), best = row["modes"], ", ".join(row["differ_most_at"])
        SCREEN.say(f"modes {first} and {second} are confused; they differ most at {best}")
    if not assessment["confused"]:
        SCREEN.say("no two modes are confused (MAC above 0.8)")
    for row in assessment["modes"]:
        if row["motion"] < _MIN_MODE_MOTION:
            SCREEN.say(
                f"mode {row['mode']} hardly moves at these channels: {row['motion']:.2g} of its "
                "largest motion"
            )
