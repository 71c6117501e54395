"""Options of ``mbw open``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Json, Key, Overwrite, Quiet, SingleJob, Without, out_option


def open_page(  # noqa: PLR0913  # one for each option
    path: Annotated[
        Path,
        typer.Argument(
            help="Campaign, MJCF of a machine, or folder of mbw tune, diagnose or identify; "
            "gallery:NAME for a built-in machine, gallery: for their names."
        ),
    ],
    *,
    state: Annotated[
        str,
        typer.Option(metavar="NAME", help="Name of the state, which is kept between sessions."),
    ] = "work",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 for a free one.")
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    band: Band = None,
    key: Key = None,
    budget: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Error budget (TOML) that follows the model."),
    ] = None,
    out: Annotated[Path | None, out_option("<path>-opened beside it")] = None,
    json: Json = None,
    jobs: SingleJob = 1,
    without: Without = None,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Open the workbench: a live page on which the model follows its sliders beside the test."""
    del jobs
    run_verb("mbw.open.verb", gallery="diagnosed", **locals())
