"""Layouts without a model: from layout.toml, a table of sites, or nodes of a universal file.

Table of sensor sites: columns site,x,y,z,axes with positions [m] and measured axes.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from identification.readers.csv_tables import read_csv_rows
from identification.readers.file_kinds import is_universal
from identification.readers.toml_files import TomlTable, Turn, read_toml
from identification.readers.uff_nodes import read_nodes
from identification.words import (
    MAX_INPUT_MAGNITUDE,
    Dof,
    InputError,
    Layout,
    Real,
    UsageError,
)
from identification.words.file_access import check_file

_DEFAULT_BODY = "structure"  # name of the body if the layout names none

Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Body(TomlTable):
    """``[body.<name>]``: a solid body; its centre is by default the mean of its sites."""

    centre: Vector3 | None = None


class _Site(TomlTable):
    """``[site.<name>]``: a sensor or hammer point; ``turn`` is a rotation vector [rad]."""

    position: Vector3
    body: str | None = None
    turn: Turn = Field(default_factory=lambda: [0.0, 0.0, 0.0])


class _LayoutFile(TomlTable):
    """Content of a layout.toml."""

    body: dict[str, _Body] = Field(default_factory=dict)
    site: dict[str, _Site] = Field(min_length=1)


def read_layout(path: Path) -> Layout:
    """Read the layout of bodies, sensors and hammer points from a file.

    A layout.toml has ``[body.<name>]`` with ``centre`` [m] and ``[site.<name>]`` with
    ``position`` [m], ``body`` (if there are several) and ``turn`` [rad]. The nodes of a universal
    file (datasets 15, 2411) become sites ``acc<node>`` of one body, with the axes of their
    displacement systems. A .csv file with the columns
    site,x,y,z,axes gives the sites of one body with world axes.

    Raises:
        InputError: the file is missing, a key is unknown, or a site names an unknown body.
    """
    check_file(path, "name the layout, a .toml, a .csv or a universal file")
    if path.suffix == ".csv":
        return read_sites(path)[0]
    return _from_nodes(path) if is_universal(path) else _from_toml(path)


def _from_toml(path: Path) -> Layout:
    """Read a layout.toml."""
    file = read_toml(path, _LayoutFile)
    bodies = tuple(file.body) or (_DEFAULT_BODY,)
    for name in (*bodies, *file.site):
        if not name or ":" in name:
            raise InputError(
                f"{path}: {name!r} is no name of a body or site, because labels such as acc1:+tx "
                "use the colon to separate point and direction: rename it"
            )
    body_of = []
    for name, site in file.site.items():
        body = site.body or (bodies[0] if len(bodies) == 1 else None)
        if body not in bodies:
            raise InputError(
                f"{path}: site.{name} "
                + (f"names the unknown body {body!r}" if body else "names no body")
                + f": name one of {', '.join(bodies)}"
            )
        body_of.append(bodies.index(body))
    positions = np.array([site.position for site in file.site.values()])
    centres = [file.body[name].centre if name in file.body else None for name in bodies]
    turns = [Rotation.from_rotvec(site.turn).as_matrix() for site in file.site.values()]
    return _layout(path, bodies, centres, tuple(file.site), np.array(body_of), positions, turns)


def _from_nodes(path: Path) -> Layout:
    """Read the nodes of a universal file as sites of one body."""
    table = read_nodes(path)
    nodes = table.nodes.values()
    if not nodes:
        raise InputError(
            f"{path} holds no nodes (dataset 15 or 2411): export them, or write a layout.toml"
        )
    names = tuple(f"acc{node.number}" for node in nodes)
    rows = np.array([node.position for node in nodes])
    axes = [node.axes for node in nodes]
    body_of = np.zeros(len(names), int)
    layout = _layout(path, (_DEFAULT_BODY,), [None], names, body_of, rows, axes)
    return replace(layout, remarks=table.remarks)


def _layout(  # noqa: PLR0917  # one argument for each field of the layout
    path: Path,
    bodies: tuple[str, ...],
    centres: list[list[float] | None],
    names: tuple[str, ...],
    body_of: np.ndarray,
    positions: np.ndarray,
    turns: list[np.ndarray],
) -> Layout:
    """Build the layout; a body without a centre has it at the mean of its sites."""
    rows = []
    for number, (body, centre) in enumerate(zip(bodies, centres, strict=True)):
        sites = positions[body_of == number]
        if centre is None and not len(sites):
            raise InputError(f"{path}: body.{body} has neither a centre nor a site: give one")
        rows.append(sites.mean(axis=0) if centre is None else centre)
    try:
        return Layout(bodies, np.array(rows), names, body_of, positions, np.array(turns))
    except ValueError as error:
        raise InputError(f"{path}: {error}: give each a different name") from error


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
