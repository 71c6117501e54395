"""Messages and progress bars on stderr, and the exit codes of errors.

Progress as plain lines for a log: stderr is no terminal, so a bar would not be seen.
"""

import functools
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from types import FrameType
from typing import ParamSpec, TypeVar

import typer
from rich.console import Console, ConsoleDimensions
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

from identification.words import InputError, WorkbenchError
from mbw.interrupts import INTERRUPTED, describe_interruption, note_interrupt
from mbw.memory_limit import REMEDY, is_out_of_memory
from mbw.streams import drop_output

INTERNAL_ERROR, NOT_CONVERGED = 1, 4
_MIN_FILE_WIDTH = 240  # characters of a table where stderr is no terminal

P = ParamSpec("P")
R = TypeVar("R")


class _MessageConsole(Console):
    """Console on stderr that falls silent once nobody reads it: the work goes on.

    A file or a pipe has no width of its own, so that tables have room for their columns there.
    """

    @property
    def size(self) -> ConsoleDimensions:
        """Width and height in characters."""
        size = super().size
        if self.is_terminal:
            return size
        return ConsoleDimensions(max(size.width, _MIN_FILE_WIDTH), size.height)

    @size.setter
    def size(self, new_size: tuple[int, int]) -> None:
        self._width, self._height = new_size

    def on_broken_pipe(self) -> None:
        """Drop this and all further messages."""
        self.quiet = True
        drop_output(2)


class Screen:
    """Printer of messages on stderr; the command sets ``quiet`` and ``debug`` once.

    Args:
        quiet: whether only errors are printed.
        debug: whether errors show their traceback.
    """

    def __init__(self, *, quiet: bool = False, debug: bool = False) -> None:
        self.quiet, self.debug = quiet, debug
        # Users choose the names of bodies and sites: [b] and :x: are text there, in tables too.
        self.console = _MessageConsole(
            stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False
        )

    def say(self, text: str) -> None:
        """Print a message, unless ``quiet`` is set."""
        if not self.quiet:
            self._print(text)

    def error(self, text: str) -> None:
        """Print an error as one line, even if ``quiet`` is set."""
        self._print(f"mbw: {' '.join(text.split())}")

    def _print(self, text: str) -> None:
        """Print a line unless stderr cannot be written, for example to a full disk."""
        with suppress(OSError):
            self.console.print(text)

    def progress(self) -> Progress:
        """Return a progress bar with a description, a count and the elapsed time.

        Where stderr is no terminal, plain lines take its place.
        """
        if not (self.quiet or self.console.is_terminal):
            return ProgressLog(self.say)
        return Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=self.console,
            disable=self.quiet,
            transient=True,
        )

    def status(self, text: str) -> AbstractContextManager[object]:
        """Show what is being computed, while a block runs."""
        if self.quiet:
            return nullcontext()
        if self.console.is_terminal:
            return self.console.status(text)
        return log_status(self.say, text)


SCREEN = Screen()


@contextmanager
def allow_one_interrupt() -> Iterator[Callable[[], None]]:
    """Raise KeyboardInterrupt on the first Ctrl-C only, so that results can still be written.

    Yields:
        A function that makes the process ignore Ctrl-C from its call on. Call it when the
        computation has ended and only the writing of files remains.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return

    pressed = False

    def ignore_interrupts() -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def raise_once(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        del number, frame
        pressed = True
        note_interrupt()
        ignore_interrupts()
        raise KeyboardInterrupt

    previous_handler = signal.signal(signal.SIGINT, raise_once)
    try:
        yield ignore_interrupts
    finally:
        if not pressed:  # after a Ctrl-C the command ends soon by itself
            signal.signal(signal.SIGINT, previous_handler)


def handle_errors(verb: Callable[P, R]) -> Callable[P, R]:
    """Wrap a verb so that every exception becomes one sentence on stderr and an exit code."""

    @functools.wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            result = verb(*args, **kwargs)
            sys.stdout.flush()
            return result
        except (typer.Exit, typer.BadParameter):
            raise
        except BrokenPipeError:  # the reader of stdout has what it wanted
            drop_output()
            raise typer.Exit(0) from None
        except (KeyboardInterrupt, Exception) as error:
            sentence, code = _describe_end(error)
            if SCREEN.debug and code == INTERNAL_ERROR:
                raise
            if SCREEN.debug:
                traceback.print_exception(error, file=SCREEN.console.file)
            if isinstance(error, OSError):
                drop_output()
            SCREEN.error(sentence)
            raise typer.Exit(code) from error

    return run


def _describe_end(error: BaseException) -> tuple[str, int]:
    """Return the sentence and the exit code of an exception."""
    if isinstance(error, KeyboardInterrupt):
        return describe_interruption(), INTERRUPTED
    if isinstance(error, WorkbenchError):
        return str(error), error.exit_code
    if is_out_of_memory(error):
        return f"the memory does not suffice: {REMEDY}", InputError.exit_code
    if isinstance(error, UnicodeError):
        return (
            f"a name or path holds characters that cannot be written here ({error}): rename it, "
            "or set PYTHONUTF8=1"
        ), InputError.exit_code
    if isinstance(error, OSError):  # of the disk and its rights, for example a full disk
        return (
            f"{error.filename or 'a file or stdout'} cannot be read or written "
            f"({error.strerror or error}): correct its name, its rights or the space on its disk"
        ), InputError.exit_code
    return (
        f"internal error, {type(error).__name__}: {error}; run again with --debug and report it"
    ), INTERNAL_ERROR


INTERVAL_S = 20.0  # between two lines: a run of an hour leaves 180


class ProgressLog(Progress):
    """Progress that prints its description, count and elapsed time every 20 s.

    A thread of its own prints the lines, so that a long step is seen to go on.

    Args:
        say: function that prints one line.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        column = TextColumn("{task.description}", markup=False)
        super().__init__(column, disable=True)  # keeps tasks, draws nothing
        self._say = say
        self._begin = time.monotonic()
        self._ended = threading.Event()
        self._printer = threading.Thread(target=self._print_lines, daemon=True)

    def start(self) -> None:
        """Start to print lines."""
        self._printer.start()

    def stop(self) -> None:
        """Print no further line."""
        self._ended.set()
        self._printer.join()

    def _print_lines(self) -> None:
        while not self._ended.wait(INTERVAL_S):
            for task in self.tasks:
                total = "" if task.total is None else f" of {task.total:g}"
                count = f" ({task.completed:g}{total})" if task.completed or total else ""
                elapsed = time.monotonic() - self._begin
                self._say(f"  after {elapsed:.0f} s: {task.description}{count}")


@contextmanager
def log_status(say: Callable[[str], None], text: str) -> Iterator[None]:
    """Print what is being computed every 20 s, while the block runs."""
    with ProgressLog(say) as progress:
        progress.add_task(text, total=None)
        yield
