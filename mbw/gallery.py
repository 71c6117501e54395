"""Built-in machines, which every verb takes by ``gallery:NAME``: each has a test and its diagnosis.

``assets/gallery/gallery.toml`` is their only table. A machine NAME has its diagnosis in the folder
``NAME-diagnosed`` beside it; the record of that folder names the campaign.
"""

import difflib
import os
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal

import typer

from identification.words import InputError
from mbw.assets import asset_path

GalleryPart = Literal["campaign", "model", "diagnosed"]
_GALLERY_PREFIX = "gallery:"
_LISTING_NAMES = ("", "list")  # they ask for the names of all machines


@cache
def read_gallery() -> Mapping[str, Mapping[str, Any]]:
    """Return the table of the gallery, its rows by the names of the machines."""
    return tomllib.loads((asset_path("gallery") / "gallery.toml").read_text(encoding="utf-8"))


def find_part(name: str, part: GalleryPart) -> Path:
    """Return the campaign, the model or the diagnosis of a machine.

    Raises:
        InputError: the gallery has no machine of this name.
    """
    if name not in read_gallery():
        near = difflib.get_close_matches(name, read_gallery(), 1)
        hint = f"did you mean {_GALLERY_PREFIX}{near[0]}? " if near else ""
        raise InputError(
            f"the gallery has no {name}: {hint}mbw open {_GALLERY_PREFIX} lists its machines"
        )
    row = read_gallery()[name]
    files = {
        "campaign": row.get("campaign", name),
        "model": row["model"],
        "diagnosed": f"{name}-diagnosed",
    }
    return Path(os.path.normpath(asset_path("gallery") / files[part]))


def resolve_names(values: Iterable[Any], part: GalleryPart) -> tuple[list[Any], dict[Path, Path]]:
    """Return the values of options with a path for each ``gallery:NAME``.

    Args:
        values: of any types; lists may hold names too.
        part: what a name stands for.

    Returns:
        The values, and paths in the current folder: beside which results go, by campaign and model,
        and into which, by the diagnosis.

    Raises:
        InputError: the gallery has no such machine.
        typer.Exit: ``gallery:`` asks for the list of machines, which is printed.
    """
    stems: dict[Path, Path] = {}

    def resolve(value: Any) -> Any:
        """Return a value with paths for names."""
        if isinstance(value, list):
            return [resolve(each) for each in value]
        if not isinstance(value, str | Path) or not str(value).startswith(_GALLERY_PREFIX):
            return value
        name = str(value).removeprefix(_GALLERY_PREFIX)
        if name in _LISTING_NAMES:
            _print_machines()
            raise typer.Exit
        for source in ("campaign", "model"):
            stems[find_part(name, source)] = Path.cwd() / name
        stems[find_part(name, "diagnosed")] = Path.cwd() / f"{name}-diagnosed"
        return type(value)(find_part(name, part))

    return [resolve(value) for value in values], stems


def _print_machines() -> None:
    """Print the name of each machine with what it is."""
    rows = read_gallery()
    width = max(map(len, rows))
    for name, row in rows.items():
        typer.echo(f"{name:<{width}}  {row['is']}")
