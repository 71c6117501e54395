"""Options of ``mbw report``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import Quiet

app = typer.Typer(rich_markup_mode=None, add_completion=False)


@app.command()
def report(
    result: Annotated[
        Path, typer.Argument(help="Folder that mbw tune, identify, diagnose or match wrote.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder or .html file; default: beside the result."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write the page of a result as one self-contained HTML file."""
    run_verb("mbw.report.verb", result, out, quiet=quiet)
