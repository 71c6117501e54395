"""Table of sensor sites: columns site,x,y,z,axes with positions [m] and measured axes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.readers.csv_tables import read_csv_rows
from identification.words import (
    MAX_INPUT_MAGNITUDE,
    Dof,
    InputError,
    Layout,
    Real,
    UsageError,
)

SITES_HEADER = ("site", "x", "y", "z", "axes")


def sites_layout(names: Sequence[str], positions: Real) -> Layout:
    """Return the layout of sites on one structure, with world axes.

    Args:
        names: names of the sites; n.
        positions: positions of the sites [m]; (n, 3).
    """
    axes = np.tile(np.eye(3), (len(names), 1, 1))
    body = np.zeros(len(names), np.intp)
    return Layout(("structure",), np.zeros((1, 3)), tuple(names), body, positions, axes)


def read_sites(path: Path) -> tuple[Layout, tuple[Dof, ...]]:
    """Read a table of sites.

    Returns:
        The layout, and the measured degrees of freedom in the order of the rows.

    Raises:
        InputError: the file is missing, its columns differ, a row is invalid, or a site is there
            twice.
    """
    rows = read_csv_rows(path, f"give a table {','.join(SITES_HEADER)}")
    if not rows or tuple(rows[0]) != SITES_HEADER:
        raise InputError(f"{path}: the first row must be {','.join(SITES_HEADER)}; correct it")
    names, places, dofs = [], [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            site, *numbers, axes = row
            place = [float(x) for x in numbers]
            is_near = len(place) == 3 and np.abs(place).max() <= MAX_INPUT_MAGNITUDE  # false: NaN
            if not is_near or not set(axes) <= set("xyz"):
                raise ValueError(row)
            measured = [Dof.parse(f"{site}:+t{axis}") for axis in dict.fromkeys(axes)]
        except (ValueError, UsageError) as error:
            raise InputError(
                f"{path}: row {number} is not a site: give a name, three numbers [m] and "
                "axes such as xz"
            ) from error
        if site in names or not measured:
            raise InputError(
                f"{path}: row {number}: {site} is there twice, or has no axis: correct the row"
            )
        names.append(site)
        places.append(place)
        dofs += measured
    if not names:
        raise InputError(f"{path} has no site: add one row for each")
    return sites_layout(names, np.array(places)), tuple(dofs)
