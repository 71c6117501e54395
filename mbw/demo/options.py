"""Options of ``mbw demo``."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Jobs, Json, Overwrite, Quiet, Seed, out_option

app = typer.Typer(rich_markup_mode=None, add_completion=False)


class DemoMachine(StrEnum):
    """Built-in machines that have a demo."""

    STATION = "station"
    GONDOLA = "gondola"


@app.command()
def demo(
    machine: Annotated[
        DemoMachine,
        typer.Argument(
            help="station: identify, tune and diagnose. gondola: match finite-element modes."
        ),
    ] = DemoMachine.STATION,
    *,
    out: Annotated[
        Path | None, out_option("mbw-demo, or mbw-demo-gondola, in the current folder")
    ] = None,
    json: Json = None,
    band: Band = None,
    jobs: Jobs = 2,
    seed: Seed = 0,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Show all steps on a built-in machine, and print the addresses of the pages."""
    if machine is DemoMachine.GONDOLA:
        run_verb(
            "mbw.demo.gondola",
            out=out or Path("mbw-demo-gondola"),
            json=json,
            band=band,
            overwrite=overwrite,
            quiet=quiet,
        )
        return
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
