"""The page of the command line is what the command says of itself."""

from typing import Annotated

import typer

from tests.docs.command_page import COMMAND_PAGE, command_page, group_page

SMALL = typer.Typer(rich_markup_mode=None, add_completion=False)


@SMALL.command()
def weigh(
    body: str,
    unit: Annotated[str, typer.Option(metavar="UNIT", help="kg | lb of <body>.")] = "kg",
) -> None:
    """Print a mass."""


@SMALL.command(hidden=True)
def secret() -> None:
    """Print nothing."""


def test_page_follows_from_the_command():
    written = COMMAND_PAGE.read_text(encoding="utf-8")
    assert written == command_page(), "python -m tests.docs makes it anew"


def test_page_holds_arguments_options_and_defaults():
    page = group_page(typer.main.get_command(SMALL), "small")
    assert "## small weigh" in page
    assert "Print a mass." in page
    assert "| Argument | Meaning |" in page
    assert "| `--unit UNIT` | kg \\| lb of &lt;body>. [default: kg] |" in page
    assert "secret" not in page
    assert "| 130 |" in page
