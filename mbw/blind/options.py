"""Options of ``mbw blind``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Jobs, Json, Overwrite, Quiet, Seed, Without, out_option


def blind(  # noqa: PLR0913  # one for each option
    model: Annotated[
        str,
        typer.Argument(help="MJCF of a machine, a campaign, or trees: random machines."),
    ],
    *,
    cases: Annotated[int, typer.Option(min=1, help="Number of virtual tests.")] = 43,
    out: Annotated[Path | None, out_option("<model>-blind beside it")] = None,
    seed: Seed = 0,
    jobs: Jobs = 1,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler, such as tcp://node1:8786."),
    ] = None,
    executor: Annotated[
        str | None,
        typer.Option(metavar="PACKAGE:FACTORY", help="Executor of concurrent.futures to run on."),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Run one of N parts; mbw blind merge joins them."),
    ] = None,
    band: Band = None,
    effect: Annotated[
        list[str] | None, typer.Option(help="Effect that is drawn; repeatable. Default: all.")
    ] = None,
    place: Annotated[
        list[str] | None, typer.Option(help="Place of the effect, such as joint:ty; repeatable.")
    ] = None,
    ratio: Annotated[
        list[float] | None,
        typer.Option(help="What a refit leaves of the effect, over the noise; repeatable."),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="NAME=VALUE", help="Parameter that sets the size, as mass=5."),
    ] = None,
    dirt: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=60.0,
            metavar="PER_CENT",
            help="Motion that small imperfections leave of a re-tuned machine.",
        ),
    ] = 0.0,
    smallest: Annotated[
        bool,
        typer.Option("--smallest", help="Predict the smallest size that nine tests of ten find."),
    ] = False,
    further: Annotated[
        bool,
        typer.Option("--further", help="Rank further hammer points, sensors and levels."),
    ] = False,
    confirm: Annotated[
        int,
        typer.Option(min=0, help="Predictions that --cases drawn cases each confirm."),
    ] = 0,
    json: Json = None,
    without: Without = None,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Score the diagnosis on withheld truth; an interrupted call continues when repeated."""
    run_verb("mbw.blind.verb", **locals())
