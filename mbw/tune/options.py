"""Options of ``mbw tune``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import (
    Band,
    CampaignFolder,
    Jobs,
    Json,
    Overwrite,
    Pictures,
    Quiet,
    Seed,
    out_option,
)

app = typer.Typer(rich_markup_mode=None, add_completion=False)


@app.command()
def tune(  # noqa: PLR0913  # one for each option
    campaign: CampaignFolder,
    *,
    out: Annotated[Path | None, out_option("<campaign>-tuned beside it")] = None,
    json: Json = None,
    band: Band = None,
    starts: Annotated[
        int, typer.Option(min=1, help="Number of starts: the nominal model, then random ones.")
    ] = 1,
    seed: Seed = 0,
    jobs: Jobs = 1,
    residual: Annotated[
        str,
        typer.Option(
            metavar="log|modal|modal,log",
            help="What is fitted: the logarithm of the FRFs' ratio; frequencies, damping and "
            "shapes of modes; or modes first and FRFs then.",
        ),
    ] = "log",
    algorithm: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Algorithm of the first stages: GAUSS_NEWTON, or one of NLopt such as LD_LBFGS.",
        ),
    ] = "GAUSS_NEWTON",
    from_modes: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Take the modes that mbw identify wrote in this folder."),
    ] = None,
    at_bodies: Annotated[
        bool,
        typer.Option(
            "--at-bodies",
            help="Compare FRFs at the centres of mass, with the covariance of their reduction.",
        ),
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted run of the same call.")
    ] = False,
    information: Annotated[
        bool,
        typer.Option(
            "--information",
            help="Rank further hammer points and sensors by the intervals that they would give.",
        ),
    ] = False,
    pictures: Pictures = True,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Tune a model to a campaign; state parameters with intervals and the remaining gap.

    The gap is the difference between the FRFs of the model and the measured ones.
    """
    run_verb(
        "mbw.tune.verb",
        campaign,
        out=out,
        json=json,
        band=band,
        starts=starts,
        seed=seed,
        jobs=jobs,
        residual=residual,
        algorithm=algorithm,
        from_modes=from_modes,
        at_bodies=at_bodies,
        resume=resume,
        information=information,
        pictures=pictures,
        overwrite=overwrite,
        quiet=quiet,
    )
