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
        band=band,
        json=json,
        overwrite=overwrite,
        quiet=quiet,
    )
