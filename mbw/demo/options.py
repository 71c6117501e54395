"""Options of ``mbw demo``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Jobs, Json, Overwrite, Quiet, Seed, out_option

app = typer.Typer(rich_markup_mode=None, add_completion=False)


@app.command()
def demo(
    out: Annotated[Path | None, out_option("mbw-demo in the current folder")] = None,
    *,
    json: Json = None,
    band: Band = None,
    jobs: Jobs = 2,
    seed: Seed = 0,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Identify, tune and diagnose the built-in station, and print the addresses of its pages."""
    run_verb(
        "mbw.demo.verb",
        out=out or Path("mbw-demo"),
        json=json,
        band=band,
        jobs=jobs,
        seed=seed,
        overwrite=overwrite,
        quiet=quiet,
    )
