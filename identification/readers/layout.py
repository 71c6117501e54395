"""Bodies and sites without a model: layout.toml, a table of sites, nodes of a universal file."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial.transform import Rotation

from identification.readers.campaign_toml import read_toml
from identification.readers.file_kinds import is_universal
from identification.readers.sites_table import read_sites
from identification.readers.uff_datasets import nodes_of, read_records
from identification.words import InputError, Layout

_ONE = "structure"  # the body of a layout that names none

Three = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Body(_Strict):
    """``[body.<name>]``: a solid body; without a centre the mean of its sites."""

    centre: Three | None = None


class _Site(_Strict):
    """``[site.<name>]``: a sensor or hammer point; its axes turned by a rotation vector [rad]."""

    position: Three
    body: str | None = None
    turn: Three = [0.0, 0.0, 0.0]


class _LayoutFile(_Strict):
    body: dict[str, _Body] = {}
    site: dict[str, _Site] = Field(min_length=1)


def read_layout(path: Path) -> Layout:
    """Read where bodies have their centres of mass and where sensors and hammer sit on them.

    A layout.toml has ``[body.<name>]`` with ``centre`` [m] and ``[site.<name>]`` with
    ``position`` [m], ``body`` (where there are several) and ``turn`` [rad]. Of a universal file
    the nodes (datasets 15, 2411) become sites ``acc<node>`` of one body. A .csv with the columns
    site,x,y,z,axes has the sites of one body, their axes those of the world.

    Raises:
        InputError: missing file, unknown key, a site on a body that is not there.
    """
    if not path.is_file():
        raise InputError(
            f"{path} does not exist: name the layout, a .toml, a .csv or a universal file"
        )
    if path.suffix == ".csv":
        return read_sites(path)[0]
    return _from_nodes(path) if is_universal(path) else _from_toml(path)


def _from_toml(path: Path) -> Layout:
    file = read_toml(path, _LayoutFile)
    bodies = tuple(file.body) or (_ONE,)
    body_of = []
    for name, site in file.site.items():
        body = site.body or (bodies[0] if len(bodies) == 1 else None)
        if body not in bodies:
            raise InputError(
                f"{path}: site.{name} sits on "
                + (f"{body!r}, which is no body" if body else "no body")
                + f": name one of {', '.join(bodies)}"
            )
        body_of.append(bodies.index(body))
    positions = np.array([site.position for site in file.site.values()])
    stated = [file.body[name].centre if name in file.body else None for name in bodies]
    turns = [Rotation.from_rotvec(site.turn).as_matrix() for site in file.site.values()]
    return _layout(path, bodies, stated, tuple(file.site), np.array(body_of), positions, turns)


def _from_nodes(path: Path) -> Layout:
    places = {node.number: node.place for node in nodes_of(path, read_records(path))}
    if not places:
        raise InputError(f"{path} holds no nodes (dataset 15 or 2411): export them, or a .toml")
    names = tuple(f"acc{node}" for node in places)
    turns = [np.eye(3)] * len(names)
    positions = np.array(list(places.values()))
    return _layout(path, (_ONE,), [None], names, np.zeros(len(names), int), positions, turns)


def _layout(  # noqa: PLR0917  # one for each field
    path: Path,
    bodies: tuple[str, ...],
    stated: list[list[float] | None],
    names: tuple[str, ...],
    body_of: np.ndarray,
    positions: np.ndarray,
    turns: list[np.ndarray],
) -> Layout:
    centres = []
    for number, (body, centre) in enumerate(zip(bodies, stated, strict=True)):
        own = positions[body_of == number]
        if centre is None and not len(own):
            raise InputError(f"{path}: body.{body} has neither a centre nor a site: give one")
        centres.append(own.mean(axis=0) if centre is None else centre)
    try:
        return Layout(bodies, np.array(centres), names, body_of, positions, np.array(turns))
    except ValueError as error:
        raise InputError(f"{path}: {error}: give each a name of its own") from error
