"""Options that several verbs share; needs typer alone, so that help and usage errors are quick.

Every verb has ``--out``, ``--json``, ``--jobs``, ``--quiet`` and ``--overwrite``; a verb that
reads frequencies has ``--band``, and one that draws random numbers has ``--seed``.
"""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand


def out_option(default: str) -> Any:
    """Return the option ``--out`` of a folder.

    Args:
        default: folder without the option, as the help states it.
    """
    return typer.Option(metavar="DIR", help=f"Folder of the results; default: {default}.")


class PairsCommand(TyperCommand):
    """Command with options of two words, which Typer lacks: ``--animate 3 mode3.gif``.

    Both words are joined by a space before the options are read.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join the words of each option whose placeholder is ``PAIR_METAVAR``, and read all."""
        pairs = {name for option in self.params for name in option.opts if _takes_pair(option)}
        joined, rest = [], list(args)
        while rest:
            word = rest.pop(0)
            joined.append(word)
            if word in pairs and len(rest) >= 2 and not rest[1].startswith("-"):
                joined.append(f"{rest.pop(0)} {rest.pop(0)}")
        return super().parse_args(ctx, joined)


def _takes_pair(option: Any) -> bool:
    return bool(option.metavar == PAIR_METAVAR)


PAIR_METAVAR = "NUMBER FILE"
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
CampaignFolder = Annotated[
    Path, typer.Argument(help="Folder with a campaign.toml, or gallery:NAME for a built-in one.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Overwrite = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace files that another campaign or model has made."),
]
Jobs = Annotated[int, typer.Option(min=1, help="Number of processes.")]
SingleJob = Annotated[
    int,
    typer.Option("--jobs", min=1, help="Number of processes; this verb is quick and works in one."),
]
Key = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Keyframe that gives pose and controls; default: home if there is one.",
    ),
]
Closed = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LOOP",
        help="Loop of the campaign, such as ty or '*', that is closed; the others are open; "
        "repeatable.",
    ),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue an interrupted run of the same call.")
]
Without = Annotated[
    str | None,
    typer.Option(
        metavar="KINDS",
        help="Leave out of models, with commas: contact, friction, limits, gravity.",
    ),
]
SoftEqualities = Annotated[
    bool,
    typer.Option(
        "--soft-equalities",
        help="Let equality constraints give way as MuJoCo's; by default they are rigid.",
    ),
]
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
