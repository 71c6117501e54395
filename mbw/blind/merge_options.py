"""Options of ``mbw blind merge``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Json, Overwrite, Quiet


def merge(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders of all shards of a test.")
    ],
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the whole test.")],
    json: Json = None,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Join the shards of a blind test into the result of the whole test."""
    run_verb("mbw.blind.merge", **locals())
