"""Ctrl-C before and after the work of a verb: the command ends quietly with code 130.

Nothing has begun while Python loads modules, so that there is nothing to keep. An exception there
would show a traceback, or be lost in the loading of a compiled module. This module is the first
that the command loads, and needs the standard library alone.
"""

import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it
_COMMAND = "mbw"


def end_on_interrupt() -> None:
    """End the process at once on Ctrl-C, if it is that of the command and handles Ctrl-C so far."""
    if _is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def raise_on_interrupt() -> None:
    """Raise KeyboardInterrupt on Ctrl-C again: the work of a verb begins."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def ignore_interrupts() -> None:
    """Ignore Ctrl-C: the work is done, and only the process has to end."""
    if _is_command():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _is_command() -> bool:
    """Return whether this process is the command: its script, or ``python -m mbw``."""
    folder, name = os.path.split(os.path.abspath(sys.argv[0] if sys.argv else ""))
    return _COMMAND in (os.path.splitext(name)[0], os.path.basename(folder))


def _end(number: int, frame: FrameType | None) -> None:
    """Say that the command was interrupted, and end the process without unwinding."""
    del number, frame
    try:
        os.write(2, b"mbw: interrupted\n")
    finally:
        os._exit(INTERRUPTED)
