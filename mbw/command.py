"""The command ``mbw VERB``: a table of verbs, each loaded when it is called.

This file and the verbs' option modules import typer and the standard library alone. The code of a
verb is loaded by ``mbw.loader`` once its options are read.
"""

import os
import sys

from mbw.interrupts import end_on_interrupt, ignore_interrupts

end_on_interrupt()  # before all that takes time to load

# ruff: noqa: E402
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from mbw.loader import SETTINGS
from mbw.memory_limit import REMEDY, is_out_of_memory
from mbw.options import PairsCommand
from mbw.streams import (
    CANNOT_BE_USED,
    describe_unreadable_argument,
    print_help_failure,
    replace_closed_streams,
)


@dataclass(frozen=True)
class Verb:
    """A verb of the command.

    Attributes:
        options: module and name of the function whose arguments are its options.
        help: one line for the list of verbs.
    """

    options: str
    help: str


VERBS = {
    "demo": Verb(
        "mbw.demo.options:demo", "Show all steps on a built-in machine: station or gondola."
    ),
    "identify": Verb("mbw.identify.options:identify", "Identify the modal model of a measurement."),
    "match": Verb("mbw.match.options:match", "Match measured modes to finite-element modes."),
    "place": Verb("mbw.match.place_options:place", "Propose places for a few sensors."),
    "predict": Verb("mbw.predict.options:predict", "Print a model's modes, FRFs and state space."),
    "models": Verb(
        "mbw.models.options:models", "List which models of a folder have a linear model."
    ),
    "view": Verb("mbw.view.options:view", "Show a machine in MuJoCo's viewer, or in a picture."),
    "open": Verb(
        "mbw.open.options:open_page", "Open the workbench: a live page of model and test."
    ),
    "live": Verb(
        "mbw.live.options:live", "Judge the hits of a running test, and plan the next one."
    ),
    "simulate": Verb(
        "mbw.simulate.options:simulate", "Make a virtual hammer test, or play a signal, in time."
    ),
    "excite": Verb(
        "mbw.excite.options:excite",
        "Design signals for a machine's drives, and say what they show.",
    ),
    "tune": Verb("mbw.tune.options:tune", "Tune a model to a measurement."),
    "diagnose": Verb(
        "mbw.diagnose.options:diagnose", "Find effects that the model lacks, and their places."
    ),
    "compare": Verb(
        "mbw.compare.options:compare",
        "Compare tests, and find the change of the machine between them.",
    ),
    "blind": Verb("mbw.blind.options:blind", "Score the diagnosis on withheld truth."),
    "blind merge": Verb("mbw.blind.merge_options:merge", "Join the shards of a blind test."),
    "report": Verb("mbw.report.options:report", "Write the page of a result as one HTML file."),
}
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class VerbGroup(TyperGroup):
    """The group of all verbs, which lists them without loading them."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all verbs."""
        return list(VERBS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Load the options of a verb and return it as a command; None for an unknown name."""
        if cmd_name not in VERBS:
            return None
        module, _, function = VERBS[cmd_name].options.partition(":")
        verb = typer.Typer(rich_markup_mode=None, add_completion=False)
        verb.command(cmd_name, cls=PairsCommand)(getattr(import_module(module), function))
        return typer.main.get_command(verb)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the verb that the first words name, with the arguments that remain.

        Raises:
            UsageError: of typer: there is no such verb; the sentence names similar ones.
        """
        if " ".join(args[:2]) in VERBS:  # a verb of two words
            args = [" ".join(args[:2]), *args[2:]]
        if args[0] not in VERBS and not args[0].startswith("-"):
            similar = get_close_matches(args[0], VERBS)
            hint = f"did you mean {' or '.join(similar)}?" if similar else "mbw --help lists them"
            ctx.fail(f"there is no verb {args[0]!r}: {hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of verbs from the table."""
        with formatter.section("Verbs"):
            formatter.write_dl([(name, verb.help) for name, verb in VERBS.items()])


app = typer.Typer(
    name="mbw",
    cls=VerbGroup,
    no_args_is_help=True,
    rich_markup_mode=None,  # rich alone takes longer to load than all the rest of the help
    pretty_exceptions_enable=False,
    subcommand_metavar="VERB [OPTIONS]",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        typer.echo(f"mbw {version('mbworkbench')}")
        raise typer.Exit


@app.callback()
def common(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")] = False,
    show_version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_print_version, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Close the gap between the multi-body model of a machine and its hammer test."""
    del show_version
    SETTINGS.debug = debug


def _refuse(sentence: str) -> int:
    """Print an error without the code of a verb; return the exit code of bad input."""
    typer.echo(f"mbw: {sentence}", err=True)
    return CANNOT_BE_USED


def main() -> None:
    """Run the command with one BLAS thread: more gain nothing here and sometimes cost dearly."""
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))  # before numpy is loaded
    arguments = sys.argv[1:]
    if "--debug" in arguments:  # may stand anywhere
        arguments.remove("--debug")
        arguments.insert(0, "--debug")
    replace_closed_streams()
    if sentence := describe_unreadable_argument(arguments):
        sys.exit(_refuse(sentence))
    try:
        app(arguments, prog_name="mbw")
    except OSError as error:
        sys.exit(print_help_failure(error))
    except (ImportError, MemoryError) as error:
        if not is_out_of_memory(error):
            raise
        sys.exit(_refuse(f"the memory does not suffice: {REMEDY}"))
    except SystemExit as error:  # of typer, which makes code 1 of a reader that has gone
        if isinstance(error.__context__, BrokenPipeError):
            sys.exit(print_help_failure(error.__context__))
        raise
    finally:
        ignore_interrupts()
