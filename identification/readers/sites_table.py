"""Sites of sensors as a table: site,x,y,z,axes with places [m] and the axes that are read."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.words import Dof, InputError, Layout, Real, UsageError

SITES_HEADER = ("site", "x", "y", "z", "axes")


def sites_layout(names: Sequence[str], positions: Real) -> Layout:
    """Sites of one structure, their axes those of the world.

    Args:
        names: of the sites.
        positions: (n, 3) [m].
    """
    axes = np.tile(np.eye(3), (len(names), 1, 1))
    body = np.zeros(len(names), np.intp)
    return Layout(("structure",), np.zeros((1, 3)), tuple(names), body, positions, axes)


def read_sites(path: Path) -> tuple[Layout, tuple[Dof, ...]]:
    """Sites, places and axes of a table.

    Raises:
        InputError: no such file, other columns, a row that is none, a site twice.
    """
    try:
        text = path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} cannot be read as text: give a table {','.join(SITES_HEADER)}"
        ) from (error)
    rows = list(csv.reader(text.splitlines()))
    if not rows or tuple(rows[0]) != SITES_HEADER:
        raise InputError(f"{path}: the first row must be {','.join(SITES_HEADER)}.")
    names, places, dofs = [], [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            site, *numbers, axes = row
            place = [float(x) for x in numbers]
            if len(place) != 3 or not np.isfinite(place).all() or not set(axes) <= set("xyz"):
                raise ValueError(row)
            own = [Dof.parse(f"{site}:+t{axis}") for axis in dict.fromkeys(axes)]
        except (ValueError, UsageError) as error:
            raise InputError(
                f"{path}: row {number} is no site: give a name, three numbers [m], axes such as xz"
            ) from error
        if site in names or not own:
            raise InputError(f"{path}: row {number}: {site} is there twice, or reads no axis.")
        names.append(site)
        places.append(place)
        dofs += own
    if not names:
        raise InputError(f"{path} has no site. Give one a row.")
    return sites_layout(names, np.array(places)), tuple(dofs)
