"""Standard streams that are closed, full or no longer read."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper

CANNOT_BE_USED = 3  # exit code of bad input, as files, paths and limits of a user are

_ASCII = ("ascii", "us-ascii", "ansi_x3.4-1968", "646")  # names of the encoding of locale C


def replace_closed_streams() -> None:
    """Open the null device in place of closed standard streams; write UTF-8 in the locale C.

    Otherwise the first file that the command opens would get the number of a closed stream, and
    messages would be written into it. A closed stdout cannot be written, so that data for it are
    no more lost in silence than on a full disk.
    """
    for number, mode in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, mode)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115  # stays open
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115  # stays open
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.encoding.lower() in _ASCII:
            stream.reconfigure(encoding="utf-8")


def drop_output(number: int = 1) -> None:
    """Send what a standard stream still holds to the null device: it can no longer be written.

    Otherwise Python tries once more at its end, and changes the exit code.

    Args:
        number: 1 for stdout, 2 for stderr.
    """
    stream, first = ((sys.stdout, sys.__stdout__), (sys.stderr, sys.__stderr__))[number - 1]
    if first is None or stream is first:  # a test may have put another one in its place
        sink = os.open(os.devnull, os.O_WRONLY)
        os.dup2(sink, number)
        os.close(sink)


def describe_unreadable_argument(arguments: list[str]) -> str | None:
    """Return a sentence on the first argument that is no UTF-8 text, or None.

    MuJoCo, JSON and pages hold names as UTF-8 only.
    """
    for argument in arguments:
        try:
            os.fsencode(argument).decode("utf-8")
        except UnicodeError:
            shown = argument.encode("utf-8", "backslashreplace").decode()
            return f"the argument {shown!r} is no UTF-8 text: rename the file or folder"
    return None


def print_help_failure(error: OSError) -> int:
    """Say on stderr that help or version cannot be written; return the exit code.

    Args:
        error: error of stdout; that its reader has gone is no failure.
    """
    drop_output()
    if isinstance(error, BrokenPipeError):
        return 0
    with suppress(OSError):
        print(f"mbw: stdout cannot be written ({error.strerror}): name another", file=sys.stderr)  # noqa: T201
    return CANNOT_BE_USED
