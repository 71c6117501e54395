"""Options of ``mbw place``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Frequencies, Json, Mesh, Overwrite, Quiet, SingleJob


def place(  # noqa: PLR0913  # one for each option
    shapes: Mesh,
    *,
    frequencies: Frequencies = None,
    channels: Annotated[
        int | None,
        typer.Option(min=1, help="Number of channels; default: three for each mode."),
    ] = None,
    apart: Annotated[
        float | None,
        typer.Option(min=0, metavar="METRES", help="Least distance between two places [m]."),
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Assess this table site,x,y,z,axes or layout.toml instead."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of sites.csv, or a .csv file; default: the table on stdout."
        ),
    ] = None,
    json: Json = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="LOW HIGH", help="Band of the modes to distinguish [Hz]; default: all elastic."
        ),
    ] = None,
    jobs: SingleJob = 1,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Propose places for a few sensors, and name the finite-element modes that they confuse."""
    del jobs
    run_verb("mbw.match.place", **locals())
