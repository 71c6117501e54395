"""Options of ``mbw report``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Json, Overwrite, Quiet, SingleJob


def report(
    result: Annotated[
        Path,
        typer.Argument(
            help="Folder that another verb wrote, the result file in it, or gallery:NAME."
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder or .html file; default: the folder of the result."
        ),
    ] = None,
    json: Json = None,
    jobs: SingleJob = 1,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Write the page of a result as one self-contained HTML file."""
    del jobs
    run_verb("mbw.report.verb", gallery="diagnosed", **locals())
