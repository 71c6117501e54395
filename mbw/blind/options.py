"""Options of ``mbw blind``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Jobs, Json, Overwrite, Quiet, Seed, out_option

app = typer.Typer(rich_markup_mode=None, add_completion=False)


@app.command()
def blind(  # noqa: PLR0913  # one for each option
    model: Annotated[str, typer.Argument(help="MJCF of a machine, or trees: random machines.")],
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
    json: Json = None,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Score the diagnosis on withheld truth; an interrupted call continues when repeated."""
    run_verb(
        "mbw.blind.verb",
        model,
        cases=cases,
        out=out,
        seed=seed,
        jobs=jobs,
        cluster=cluster,
        executor=executor,
        shard=shard,
        band=band,
        json=json,
        overwrite=overwrite,
        quiet=quiet,
    )
