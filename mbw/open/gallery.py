"""``mbw open gallery:NAME``: built-in machines with a test, its diagnosis and a picture.

``assets/gallery/gallery.toml`` is their only table. A machine NAME has its diagnosis in the folder
``NAME-diagnosed`` beside it; the record of that folder names the campaign.
"""

import difflib
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import typer

from identification.words import InputError
from mbw.assets import asset_path

_GALLERY_PREFIX = "gallery:"
_LISTING_NAMES = ("", "list")  # they ask for the names of all machines


@cache
def read_gallery() -> Mapping[str, Mapping[str, Any]]:
    """Return the table of the gallery, its rows by the names of the machines."""
    return tomllib.loads((asset_path("gallery") / "gallery.toml").read_text(encoding="utf-8"))


def diagnosed_folder(name: str) -> Path:
    """Return the folder with the diagnosis of a machine.

    Raises:
        InputError: the gallery has no machine of this name.
    """
    if name not in read_gallery():
        near = difflib.get_close_matches(name, read_gallery(), 1)
        hint = f"did you mean {_GALLERY_PREFIX}{near[0]}? " if near else ""
        raise InputError(
            f"the gallery has no {name}: {hint}mbw open {_GALLERY_PREFIX} lists its machines"
        )
    return asset_path("gallery") / f"{name}-diagnosed"


def resolve_gallery(path: Path, out: Path | None) -> tuple[Path, Path | None] | None:
    """Return what a path of the gallery stands for, and the folder for saved models.

    Other paths are returned as they are. ``gallery:`` prints the machines and returns None.

    Args:
        path: what the user opens.
        out: folder that was stated; None for the default, which is the current folder here.

    Raises:
        InputError: the gallery has no such machine.
    """
    name = str(path).removeprefix(_GALLERY_PREFIX)
    if name == str(path):
        return path, out
    if name not in _LISTING_NAMES:
        return diagnosed_folder(name), out or Path(f"{name}-opened")
    rows = read_gallery()
    width = max(map(len, rows))
    for each, row in rows.items():
        typer.echo(f"{each:<{width}}  {row['is']}")
    return None
