"""Standard streams that are closed, full or no longer read."""

import os
import sys
from contextlib import suppress

_CANNOT_BE_WRITTEN = 3  # exit code of bad input, which files and folders of a user are


def replace_closed_streams() -> None:
    """Open the null device in place of closed standard streams.

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
    return _CANNOT_BE_WRITTEN
