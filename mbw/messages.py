"""Messages and progress to stderr, errors to exit codes: one place for both."""

import functools
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import ParamSpec, TypeVar

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

from identification.words import WorkbenchError

INTERNAL_ERROR, NOT_CONVERGED, INTERRUPTED = 1, 4, 130

P = ParamSpec("P")
R = TypeVar("R")


class Screen:
    """Where messages go; ``--quiet`` and ``--debug`` are set once by the command.

    Args:
        quiet: say errors only.
        debug: show tracebacks.
    """

    def __init__(self, *, quiet: bool = False, debug: bool = False) -> None:
        self.quiet, self.debug = quiet, debug
        # Names of bodies and sites are text of users, in tables too: [b] and :x: mean themselves.
        self.console = Console(
            stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False
        )

    def say(self, text: str) -> None:
        """Print one message, unless quiet."""
        if not self.quiet:
            self.console.print(text)

    def error(self, text: str) -> None:
        """Print one sentence, quiet or not."""
        self.console.print(f"mbw: {' '.join(text.split())}")

    def progress(self) -> Progress:
        """A bar with a description, elapsed time and the count."""
        return Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=self.console,
            disable=self.quiet,
            transient=True,
        )


SCREEN = Screen()


@contextmanager
def one_interrupt() -> Iterator[Callable[[], None]]:
    """Let the first Ctrl-C through and no other, so that what was found can be written.

    Yields:
        What to call when the work is done and only writing is left: from then on none comes
        through.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return

    pressed = False

    def ignore() -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def first(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        del number, frame
        pressed = True
        ignore()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, first)
    try:
        yield ignore
    finally:
        if not pressed:  # else the command is about to leave: nobody needs to hurry it
            signal.signal(signal.SIGINT, before)


def guarded(verb: Callable[P, R]) -> Callable[P, R]:
    """Turn every exception of a verb into one sentence and an exit code."""

    @functools.wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return verb(*args, **kwargs)
        except (typer.Exit, typer.BadParameter):
            raise
        except KeyboardInterrupt:
            SCREEN.error("interrupted")
            raise typer.Exit(INTERRUPTED) from None
        except WorkbenchError as error:
            if SCREEN.debug:
                raise
            SCREEN.error(str(error))
            raise typer.Exit(error.exit_code) from error
        except BrokenPipeError:
            sys.stderr.close()
            raise typer.Exit(0) from None
        except Exception as error:
            if SCREEN.debug:
                raise
            SCREEN.error(
                f"internal error, {type(error).__name__}: {error}; run again with --debug and "
                "report it"
            )
            raise typer.Exit(INTERNAL_ERROR) from error

    return run
