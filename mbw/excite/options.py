"""Options of ``mbw excite``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import (
    Json,
    Key,
    Overwrite,
    Pictures,
    Quiet,
    Seed,
    SingleJob,
    SoftEqualities,
    Without,
    out_option,
)


def excite(  # noqa: PLR0913  # one for each option
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL|CAMPAIGN",
            help="MJCF of a machine, campaign with its loops, or folder of mbw tune or diagnose.",
        ),
    ],
    *,
    drives: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Motors, joint:<name> or forces such as acc1:+tx, all at once. Default: all of "
            "--limits and --limit, or the motors of the campaign's [log].",
        ),
    ] = None,
    limits: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="TOML with [drive.NAME]: force, current with motor_constant, stroke, speed, at.",
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DRIVE:NAME=VALUE,...",
            help="Limits of a drive in SI, such as servo:force=200,stroke=1e-3; repeatable.",
        ),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            metavar="LABEL",
            help="What is recorded: encoder, acc7:+tx or joint:<name>; repeatable. Default: "
            "encoders of [log], else encoders and accelerometers of the model.",
        ),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LABEL=DENSITY",
            help="White noise of an output, one-sided [unit/sqrt(Hz)]; repeatable.",
        ),
    ] = None,
    resolution: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LABEL=STEP", help="Smallest step of an encoder [m or rad]; repeatable."
        ),
    ] = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LOW HIGH", help="Frequency band [Hz]. Default: that of the modes."),
    ] = None,
    seconds: Annotated[
        float, typer.Option(metavar="S", help="Length of the record, at most [s].")
    ] = 60.0,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", help="Samples per second. Default: a usual rate, five times the band."
        ),
    ] = None,
    kind: Annotated[
        str,
        typer.Option(help="multisine: all lines at once, low peak; sweep: one after the other."),
    ] = "multisine",
    key: Key = None,
    out: Annotated[Path | None, out_option("<model>-excited beside it")] = None,
    pictures: Pictures = True,
    json: Json = None,
    seed: Seed = 0,
    jobs: SingleJob = 1,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Design signals for a machine's drives under their limits, and say what they will show.

    The result is a campaign of the record that the nominal machine would give.
    """
    del jobs
    run_verb("mbw.excite.verb", **locals())
