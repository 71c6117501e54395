"""Options of ``mbw view``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Json, Key, Overwrite, Quiet, SingleJob, SoftEqualities, Without


def view(  # noqa: PLR0913  # one for each option
    model: Annotated[Path, typer.Argument(help="MJCF of a machine.")],
    *,
    mode: Annotated[
        int | None,
        typer.Option(
            min=1, help="Number of the mode in the table of mbw predict; default: at rest."
        ),
    ] = None,
    key: Key = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a .gif, .webp, .mp4, .webm or .png (still) and open no window.",
        ),
    ] = None,
    json: Json = None,
    jobs: SingleJob = 1,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Show a machine in MuJoCo's viewer, at rest or moving in a mode; or write a picture."""
    del jobs
    run_verb("mbw.view.verb", gallery="model", **locals())
