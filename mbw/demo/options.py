"""Options of ``mbw demo``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Jobs, Quiet

app = typer.Typer(rich_markup_mode=None, add_completion=False)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the results.")] = Path(
        "mbw-demo"
    ),
    jobs: Jobs = 2,
    quiet: Quiet = False,
) -> None:
    """Identify, tune and diagnose the built-in station, and print the addresses of its pages."""
    run_verb("mbw.demo.verb", out, jobs, quiet=quiet)
