"""Options that several verbs share; needs typer alone, so that help and usage errors are quick."""

from pathlib import Path
from typing import Annotated

import typer

Band = Annotated[
    tuple[float, float] | None,
    typer.Option(
        metavar="LOW HIGH",
        help="Frequency band [Hz]; default: the frequency lines with coherence.",
    ),
]
Json = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write the result as JSON; - is stdout.")
]
CampaignFolder = Annotated[Path, typer.Argument(help="Folder with a campaign.toml.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Jobs = Annotated[int, typer.Option(min=1, help="Number of processes.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")]
Pictures = Annotated[
    bool, typer.Option("--pictures/--no-pictures", help="Write the page with pictures.")
]
Mesh = Annotated[Path, typer.Argument(help="Mesh with mode shapes as point data.")]
Frequencies = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Table of the mode shapes' natural frequencies [Hz], one a row."
    ),
]
