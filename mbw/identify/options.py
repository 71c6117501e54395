"""Options of ``mbw identify``."""

import math
from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import (
    PAIR_METAVAR,
    Band,
    CampaignFolder,
    Json,
    Overwrite,
    Pictures,
    Quiet,
    SingleJob,
    Without,
    out_option,
)


def identify(  # noqa: PLR0913  # one for each option
    campaign: CampaignFolder,
    *,
    out: Annotated[Path | None, out_option("<campaign>-modes beside it")] = None,
    json: Json = None,
    band: Band = None,
    frequency: Annotated[
        float,
        typer.Option(
            "--frequency-tolerance",
            min=0,
            metavar="RATIO",
            help="Largest relative difference of one mode's frequencies.",
        ),
    ] = 0.01,
    damping: Annotated[
        float,
        typer.Option(
            "--damping-tolerance",
            min=0,
            metavar="RATIO",
            help="Largest relative difference of one mode's damping ratios.",
        ),
    ] = 0.3,
    participation: Annotated[
        float,
        typer.Option(
            "--mac-tolerance",
            min=0,
            max=1,
            metavar="MAC",
            help="Least MAC of one mode's participation.",
        ),
    ] = 0.8,
    persistence: Annotated[
        float, typer.Option(min=0, max=1, help="Least share of model orders that hold a mode.")
    ] = 0.3,
    highest_damping: Annotated[
        float,
        typer.Option(
            min=0,
            max=100,
            metavar="PERCENT",
            help="Highest damping ratio of a mode, in per cent.",
            callback=lambda percent: percent / 100,
        ),
    ] = 20.0,
    collinearity: Annotated[
        float,
        typer.Option(min=0, max=1, metavar="MPC", help="Least modal phase collinearity of a mode."),
    ] = 0.0,
    phase_deviation: Annotated[
        float,
        typer.Option(
            min=0,
            metavar="DEGREES",
            help="Largest mean phase deviation of a mode.",
            callback=lambda degrees: math.radians(degrees),  # noqa: PLW0108  # called by keyword
        ),
    ] = 180.0,
    add: Annotated[
        list[float] | None,
        typer.Option(metavar="HZ", help="Start a mode at this frequency; repeatable."),
    ] = None,
    drop: Annotated[
        list[float] | None,
        typer.Option(metavar="HZ", help="Leave out the mode at this frequency; repeatable."),
    ] = None,
    force: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HZ,PERCENT",
            help="Keep a mode of this frequency and damping ratio in per cent, negative if it "
            "grows; repeatable.",
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Universal file of mode shapes to compare with; default: the nominal model.",
        ),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Write the full matrix of synthesised FRFs.")
    ] = False,
    compare: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="CAMPAIGN",
            help="Campaign with another hammer tip, shown side by side in tips.html; repeatable.",
        ),
    ] = None,
    animate: Annotated[
        list[str] | None,
        typer.Option(
            metavar=PAIR_METAVAR,
            help="Write mode NUMBER as .gif, .webp, .mp4, .webm, or .png (still); repeatable.",
        ),
    ] = None,
    pictures: Pictures = True,
    jobs: SingleJob = 1,
    without: Without = None,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Identify the measured modal model: poles, damping, shapes, with standard deviations."""
    del jobs
    run_verb("mbw.identify.verb", **locals())
