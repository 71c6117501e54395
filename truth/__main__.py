"""The command ``python -m truth``: a virtual hammer test of a machine whose faults are known."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits

from truth.campaign.cause import Cause, Wanted
from truth.campaign.draw import REAL_INSTRUMENTS, Tolerances
from truth.campaign.folder import check_folder, write_answer, write_campaign
from truth.campaign.protocol import Protocol, draw_protocol
from truth.campaign.virtual_test import Plan, draw_campaign
from truth.effects import CATALOGUE, RIVALS
from truth.effects.outside import OUTSIDE
from truth.errors import TruthError
from truth.machine.mujoco_reader import read_station
from truth.machine.random_tree import draw_tree

BAD_INPUT = 3
TREE = "tree"

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def generate(  # noqa: PLR0913  # one parameter for each option of the command
    nominal: Annotated[Path, typer.Argument(help=f"MJCF of the nominal machine, or {TREE!r}.")],
    folder: Annotated[Path, typer.Argument(help="Where the campaign is written.")],
    *,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all draws; it holds the answer.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(help=f"One of {', '.join([*CATALOGUE, *RIVALS, *OUTSIDE])}; may be repeated."),
    ] = None,
    place: Annotated[
        str | None, typer.Option(help="Where the first effect sits, as joint:ty; else drawn.")
    ] = None,
    ratio: Annotated[
        float | None, typer.Option(help="Survival ratio of each effect; else its size is drawn.")
    ] = None,
    mistuned: Annotated[
        bool, typer.Option("--mistuned", help="Stiffness and damping alone are off, by twice.")
    ] = False,
    drawn: Annotated[
        bool, typer.Option("--drawn-protocol", help="Draw how it is tested: levels, set-ups ...")
    ] = False,
    averages: Annotated[int, typer.Option(min=2, help="Hits per direction.")] = 10,
    level: Annotated[float, typer.Option(help="Peak force of the hits [N].")] = 200.0,
    node: Annotated[int | None, typer.Option(help="Measuring point where the hammer hits.")] = None,
    dirt: Annotated[
        float,
        typer.Option(
            metavar="PER_CENT",
            help="Motion that small imperfections leave of a re-tuned machine, such as 15.",
        ),
    ] = 0.0,
    real: Annotated[
        bool,
        typer.Option(
            "--real-instruments",
            help="Delays and cross-talk of sensors, gain and delay of the force channel are off.",
        ),
    ] = False,
    rigid: Annotated[int, typer.Option(min=0, help="Directions that are made rigid.")] = 0,
    answer: Annotated[
        Path | None, typer.Option(help="Where the answer is sealed; else in the folder.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a campaign.")] = False,
) -> None:
    """Draw a machine about the nominal one, give it effects, hit it, and write the campaign."""
    try:
        check_folder(folder, overwrite=overwrite)
        station = draw_tree(seed) if str(nominal) == TREE else read_station(nominal)
        protocol = Protocol((station.first_aim(),), (level,), averages)
        if drawn:
            protocol = draw_protocol(station, seed)
        if node is not None:
            protocol = replace(protocol, nodes=(node,))
        named = [name for name in effect or [] if name != "none"]
        wanted = tuple(
            Wanted(name, None if number else place, ratio) for number, name in enumerate(named)
        )
        if place is not None and not wanted:
            raise TruthError(f"{place!r}: the effect none has no place; leave it out")
        plan = Plan(
            seed,
            Cause(wanted, mistuned=mistuned),
            protocol,
            REAL_INSTRUMENTS if real else Tolerances(),
            rigid=rigid,
            dirt=dirt,
        )
        with threadpool_limits(1):  # more threads round otherwise: the bytes would be others
            campaign = draw_campaign(station, plan)
        typer.echo(f"sha256 of answer.toml: {campaign.answer_hash}", err=True)
        write_campaign(campaign, folder, overwrite=overwrite, sealed=answer is not None)
        if answer is not None:
            write_answer(campaign, answer)
    except (TruthError, OSError) as error:
        typer.echo(f"truth: {error}", err=True)
        raise typer.Exit(BAD_INPUT) from error


if __name__ == "__main__":
    app(prog_name="python -m truth")
