"""Options of ``mbw diagnose``."""

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
    Resume,
    Seed,
    SoftEqualities,
    Without,
    out_option,
)


def diagnose(  # noqa: PLR0913  # one for each option
    campaign: CampaignFolder,
    *,
    out: Annotated[Path | None, out_option("<campaign>-diagnosed beside it")] = None,
    json: Json = None,
    band: Band = None,
    jobs: Jobs = 1,
    explain: Annotated[
        bool, typer.Option("--explain", help="Print the hypotheses that were tried and rejected.")
    ] = False,
    resume: Resume = False,
    seed: Seed = 0,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    pictures: Pictures = True,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Find effects that the model lacks, their places, and how far the gap shrinks with them.

    The gap is the difference between the FRFs of the model and the measured ones. The diagnosis
    draws no random numbers: every --seed gives the same verdict.
    """
    del seed
    run_verb("mbw.diagnose.verb", **locals())
