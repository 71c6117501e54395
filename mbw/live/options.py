"""Options of ``mbw live``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Json, Overwrite, Quiet, SingleJob, Without, out_option


def live(  # noqa: PLR0913  # one for each option
    folder: Annotated[
        Path,
        typer.Argument(help="Folder with campaign.toml, into which the records of the hits come."),
    ],
    *,
    idle: Annotated[
        float | None,
        typer.Option(
            min=0, metavar="S", help="End when nothing has come for so long [s]. Default: Ctrl-C."
        ),
    ] = None,
    terminal: Annotated[
        bool, typer.Option("--terminal", help="Keep to the terminal: serve no page.")
    ] = False,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    band: Band = None,
    out: Annotated[Path | None, out_option("<folder>-accepted beside it")] = None,
    json: Json = None,
    jobs: SingleJob = 1,
    without: Without = None,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Judge each hit of a running hammer test, and say where to hit next and when to stop."""
    del jobs
    run_verb("mbw.live.verb", **locals())
