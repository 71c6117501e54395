"""``mbw place``: where sensors tell simulated modes apart, and which modes a layout confuses."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from identification.matching import at_channels
from identification.readers.layout import read_layout
from identification.readers.sites_table import SITES_HEADER, read_sites, sites_layout
from identification.shapes import (
    Shapes,
    antinodes,
    effective_independence,
    read_shapes,
    rigid_modes,
    telling,
)
from identification.words import Dof, InputError, Integers, Layout
from mbw.match.verb import Simulated
from mbw.messages import SCREEN

_APART = 0.05  # of the mesh's diagonal, between candidates
_FEW = 3  # channels that tell a pair


@dataclass(frozen=True)
class Wanted:
    """What to place.

    Args:
        channels: how many; three for each mode if None.
        band: whose modes are to be told apart [Hz]; all elastic ones if None.
        apart: of two places at least [m]; 5 % of the mesh's diagonal if None.
    """

    channels: int | None
    band: tuple[float, float] | None
    apart: float | None


def run(simulated: Simulated, wanted: Wanted, check: Path | None, out: Path | None) -> None:
    """Propose places and directions, or look at those of a table; print which modes they confuse.

    Args:
        simulated: shapes.
        wanted: what to place.
        check: a table of sites, or a layout, to look at instead.
        out: where to write the proposal; stdout if None.

    Raises:
        InputError: files that cannot be used, no elastic mode in the band.
        UsageError: too few channels for the modes.
    """
    whole = read_shapes(simulated.path, simulated.frequencies)
    held = rigid_modes(whole).held
    low, high = wanted.band or (0.0, np.inf)
    chosen = np.flatnonzero(held & (whole.frequencies >= low) & (whole.frequencies <= high))
    if not len(chosen):
        raise InputError(f"{whole.source} has no mode between {low:g} and {high:g} Hz.")
    shapes = whole.only(chosen)
    if check is not None:
        layout, dofs = _looked_at(check)
    else:
        layout, dofs = proposed(shapes, wanted)
        text = written(layout, dofs)
        if out is None:
            typer.echo(text, nl=False)
        else:
            _write(text, out)
    _say(shapes, chosen + 1, layout, dofs)


def proposed(shapes: Shapes, wanted: Wanted) -> tuple[Layout, tuple[Dof, ...]]:
    """Channels by effective independence, of candidates some way apart, antinodes among them."""
    count = wanted.channels or 3 * len(shapes)
    apart = _APART * shapes.extent if wanted.apart is None else wanted.apart
    places = _candidates(shapes, apart)
    at = shapes.vectors[:, places]  # (n_mode, n_place, 3)
    kept = effective_independence(at.reshape(len(shapes), -1), count)
    points, axes = places[kept // 3], kept % 3
    order = list(dict.fromkeys(points.tolist()))
    layout = sites_layout([f"acc{k + 1}" for k in range(len(order))], shapes.points[order])
    dofs = tuple(
        Dof.of(layout.points[order.index(point)], axis)
        for point, axis in zip(points.tolist(), axes.tolist(), strict=True)
    )
    return layout, dofs


def _candidates(shapes: Shapes, apart: float) -> Integers:
    """Points some way apart: every mode's antinode first, then as the mesh has them."""
    used = np.unique(shapes.triangles)
    best = antinodes(shapes.vectors[:, used])
    order = used[np.append(best, np.setdiff1d(np.arange(len(used)), best))]
    left = np.ones(len(order), bool)
    chosen = []
    for k, point in enumerate(order.tolist()):
        if left[k]:
            chosen.append(point)
            away = np.linalg.norm(shapes.points[order] - shapes.points[point], axis=1)
            left &= away >= apart
    return np.array(chosen, np.intp)


def written(layout: Layout, dofs: Sequence[Dof]) -> str:
    """A table of sites, places [m] and axes."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(SITES_HEADER)
    for site, place in zip(layout.points, layout.positions, strict=True):
        axes = "".join(sorted(dof.direction[-1] for dof in dofs if dof.point == site))
        table.writerow([site, *(f"{x:.6g}" for x in place), axes])
    return text.getvalue()


def _looked_at(path: Path) -> tuple[Layout, tuple[Dof, ...]]:
    """A table of sites with its axes, or a layout with three axes at every site."""
    if path.suffix == ".csv":
        return read_sites(path)
    layout = read_layout(path)
    return layout, tuple(Dof.of(site, axis) for site in layout.points for axis in range(3))


def _write(text: str, out: Path) -> None:
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}): name another") from error
    SCREEN.say(f"places in {out}")


def _say(shapes: Shapes, numbers: Integers, layout: Layout, dofs: Sequence[Dof]) -> None:
    """Which modes the channels confuse, and which pair is nearest to that."""
    at = at_channels(shapes, layout, dofs)
    found = telling(at)
    modes = ", ".join(f"{n} ({f:.2f} Hz)" for n, f in zip(numbers, shapes.frequencies, strict=True))
    SCREEN.say(f"{len(dofs)} channels at {len(layout.points)} sites for the modes {modes}")
    apart = found.mac - np.eye(len(at))
    if len(at) > 1:
        first, second = divmod(int(apart.argmax()), len(apart))
        SCREEN.say(
            f"most alike there: modes {numbers[first]} and {numbers[second]}, "
            f"MAC {apart[first, second]:.2f}"
        )
    for (one, other), channels in zip(found.confused, found.channels, strict=True):
        best = ", ".join(str(dofs[k]) for k in channels[:_FEW])
        SCREEN.say(
            f"modes {numbers[one]} and {numbers[other]} are confused; what tells them is {best}"
        )
    if not found.confused:
        SCREEN.say("no two modes are confused (MAC above 0.8)")
    weak = np.linalg.norm(at, axis=1) / np.linalg.norm(shapes.vectors, axis=2).max(axis=1)
    for number, size in zip(numbers, weak, strict=True):
        if size < 0.1:
            SCREEN.say(f"mode {number} hardly moves there: {size:.2g} of its greatest motion")
