"""Options of ``mbw models``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Json, Overwrite, Quiet, SingleJob, SoftEqualities, Without


def models(
    folder: Annotated[Path, typer.Argument(help="Folder with MJCF and URDF files, at any depth.")],
    *,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the table as tab-separated text.")
    ] = None,
    json: Json = None,
    jobs: SingleJob = 1,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """List the models of a folder on stdout: coordinates of each, or why it has no linear model."""
    del jobs
    run_verb("mbw.models.verb", **locals())
