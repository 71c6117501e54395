"""Options of ``mbw demo``."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Band, Jobs, Json, Overwrite, Quiet, Seed, out_option


class DemoMachine(StrEnum):
    """Built-in machines that have a demo."""

    STATION = "station"
    GONDOLA = "gondola"


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
    options = locals()
    del options["machine"]
    if machine is DemoMachine.GONDOLA:
        del options["jobs"], options["seed"]
        run_verb("mbw.demo.gondola", **options)
    else:
        run_verb("mbw.demo.verb", **options)
