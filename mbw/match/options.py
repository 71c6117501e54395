"""Options of ``mbw match``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Frequencies, Json, Mesh, Overwrite, Quiet, SingleJob, out_option


def match(  # noqa: PLR0913  # one for each option
    shapes: Mesh,
    campaign: Annotated[Path, typer.Argument(help="Folder with a campaign.toml of impacts.")],
    *,
    out: Annotated[Path | None, out_option("<campaign>-matched beside it")] = None,
    frequencies: Frequencies = None,
    mass: Annotated[
        str | None,
        typer.Option(
            metavar="KG[+-KG]",
            help="Mass of the structure, as 800+-40; a model of another mass gets a remark. "
            "Default tolerance: 5 %.",
        ),
    ] = None,
    nearest: Annotated[
        bool,
        typer.Option("--nearest", help="Take shapes at the nearest node; default: interpolate."),
    ] = False,
    width: Annotated[
        float,
        typer.Option(min=0, metavar="HZ", help="Width of the sliding average of amplitudes [Hz]."),
    ] = 0.3,
    band: Band = None,
    json: Json = None,
    jobs: SingleJob = 1,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Match measured modes to finite-element modes (few sensors, force not measured)."""
    del jobs
    run_verb("mbw.match.verb", **locals())
