"""Options of ``mbw tune``."""

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
    Resume,
    Seed,
    SoftEqualities,
    Without,
    out_option,
)

# Options that mean nothing with a table of modes, which has no FRFs.
OPTIONS_OF_CAMPAIGNS = (
    "band", "residual", "algorithm", "from_modes", "at_bodies", "resume", "information", "jobs"
)  # fmt: skip
OPTIONS_OF_TABLES = ("prior", "complete_below")


def tune(  # noqa: PLR0913  # one for each option
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="CAMPAIGN|MODEL",
            help="Folder with a campaign.toml; with --modes, the MJCF of a machine.",
        ),
    ],
    *,
    out: Annotated[Path | None, out_option("<source>-tuned beside it")] = None,
    json: Json = None,
    band: Band = None,
    starts: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Number of starts: the nominal model, then random ones. Default: 1; with --modes "
            "as many as it takes to reach every row, at most 12.",
        ),
    ] = None,
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
            help="Algorithm for stiffness and damping: one of NLopt, such as LD_LBFGS, LD_SLSQP, "
            "LD_VAR2 or LD_MMA, or GAUSS_NEWTON. Tolerances are always fitted by Gauss-Newton.",
        ),
    ] = "LD_LBFGS",
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
    modes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Tune MODEL to a table of modes without shapes, a CSV file with the columns "
            "frequency, damping, body, direction.",
        ),
    ] = None,
    complete_below: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            help="With --modes: the table has all modes of the machine below this frequency, so "
            "that the model shall have no others there.",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=SD",
            help="With --modes: standard deviation of a parameter's logarithm about the nominal "
            "value, 0 to fix it; a name or a pattern such as '*.damping'; repeatable.",
        ),
    ] = None,
    resume: Resume = False,
    information: Annotated[
        bool,
        typer.Option(
            "--information",
            help="Rank further hammer points and sensors by the intervals that they would give.",
        ),
    ] = False,
    pictures: Pictures = True,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Tune a model to a campaign; state parameters with intervals and the remaining gap.

    The gap is the difference between the FRFs of the model and the measured ones.

    With --modes, tune it to a table of modes instead.
    """
    options = locals()
    meaningless = OPTIONS_OF_TABLES if modes is None else OPTIONS_OF_CAMPAIGNS
    misplaced = [name for name in meaningless if _is_stated(context, name)]
    for name in ("context", *meaningless, *(("modes",) if modes is None else ())):
        del options[name]
    module = "mbw.tune.verb" if modes is None else "mbw.tune.mode_table"
    run_verb(module, misplaced=misplaced, **options)


def _is_stated(context: typer.Context, name: str) -> bool:
    """Return whether the user stated an option, even with its default value."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
