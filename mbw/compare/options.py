"""Options of ``mbw compare``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import (
    Band,
    Jobs,
    Json,
    Overwrite,
    Pictures,
    Quiet,
    SoftEqualities,
    Without,
    out_option,
)


def compare(  # noqa: PLR0913  # one for each option
    campaigns: Annotated[
        list[Path],
        typer.Argument(help="Two campaigns or more, or a folder of campaigns: a fleet."),
    ],
    *,
    out: Annotated[
        Path | None, out_option("<first>-<second>-compared, <folder>-compared, beside the first")
    ] = None,
    json: Json = None,
    band: Band = None,
    two_machines: Annotated[
        bool,
        typer.Option(
            "--two-machines",
            help="Two machines of one drawing, or two laboratories; default: one machine before "
            "and after a change.",
        ),
    ] = False,
    diagnosis: Annotated[
        bool,
        typer.Option(
            "--diagnosis/--no-diagnosis", help="Search which change of the machine explains it."
        ),
    ] = True,
    jobs: Jobs = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted diagnosis of the same call.")
    ] = False,
    pictures: Pictures = True,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Compare tests: modes, FRFs, and the change of the machine that explains a difference.

    The first campaign is before the change, the second after it. Three campaigns or more are a
    fleet: what varies from machine to machine, without a diagnosis.
    """
    run_verb("mbw.compare.verb", **locals())
