"""The command ``python -m truth``: a virtual hammer test of a machine whose faults are known."""

from pathlib import Path
from typing import Annotated

import typer

from truth.campaign import Plan, draw_campaign
from truth.effects import CATALOGUE
from truth.errors import TruthError
from truth.folder import check_folder, write_campaign
from truth.reader import read_station

BAD_INPUT = 3

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def generate(  # noqa: PLR0913  # one parameter for each option of the command
    nominal: Annotated[Path, typer.Argument(help="MJCF of the nominal station.")],
    folder: Annotated[Path, typer.Argument(help="Where the campaign is written.")],
    *,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all draws; it holds the answer.")],
    effect: Annotated[str, typer.Option(help=f"One of {', '.join(CATALOGUE)}.")] = "none",
    body: Annotated[str | None, typer.Option(help="Where the effect sits; else drawn.")] = None,
    averages: Annotated[int, typer.Option(min=2, help="Hits per direction.")] = 10,
    level: Annotated[float, typer.Option(help="Peak force of the hits [N].")] = 200.0,
    node: Annotated[int, typer.Option(help="Measuring point where the hammer hits.")] = 11,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a campaign.")] = False,
) -> None:
    """Draw a machine about the nominal one, give it an effect, hit it, and write the campaign."""
    plan = Plan(seed, effect, body, averages, level, node)
    try:
        check_folder(folder, overwrite=overwrite)
        campaign = draw_campaign(read_station(nominal), plan)
        typer.echo(f"sha256 of answer.toml: {campaign.answer_hash}", err=True)
        write_campaign(campaign, folder, overwrite=overwrite)
    except (TruthError, OSError) as error:
        typer.echo(f"truth: {error}", err=True)
        raise typer.Exit(BAD_INPUT) from error


if __name__ == "__main__":
    app(prog_name="python -m truth")
