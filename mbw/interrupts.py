"""Ctrl-C and SIGTERM around the work of a verb: the command ends with one sentence.

Nothing has begun while Python loads modules, so that there is nothing to keep. An exception there
would show a traceback, or be lost in the loading of a compiled module. This module is the first
that the command loads, and needs the standard library alone.

While a verb works, Ctrl-C raises KeyboardInterrupt once compiled code returns to
Python. A thread reads each signal at once: it ends the command on SIGTERM, and on a Ctrl-C that
Python has not seen within a second or two.
"""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from types import FrameType

INTERRUPTED, TERMINATED = 130, 143  # exit codes after Ctrl-C and SIGTERM, as shells have them
MAX_DEAF_S = 1.5  # after Ctrl-C, until the command ends without unwinding
_COMMAND = "mbw"
_SHOW_CURSOR = "\r\x1b[K\x1b[?25h"  # a progress bar hides it


class _Watch:
    """State that the command shares with the thread that reads signals.

    Args:
        is_seen: set once Python has handled a Ctrl-C.
        advise: returns how to continue an interrupted run; empty if nothing can be continued.
        ending: held by the thread that ends the process.
    """

    def __init__(self) -> None:
        self.is_seen = threading.Event()
        self.advise: Callable[[], str] = str
        self.ending = threading.Lock()


_WATCH = _Watch()


def end_on_interrupt() -> None:
    """End the process at once on Ctrl-C, if it is that of the command and handles Ctrl-C so far."""
    if _is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            signal.signal(signal.SIGTERM, _end)


def raise_on_interrupt() -> None:
    """Raise KeyboardInterrupt on Ctrl-C again: the work of a verb begins."""
    _WATCH.advise = str
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, _raise)
        _start_watch()


def note_interrupt() -> None:
    """State that Python has handled a Ctrl-C, so that the work ends by itself."""
    _WATCH.is_seen.set()


def advise_at_end(advise: Callable[[], str]) -> None:
    """State what returns how to continue an interrupted run, or an empty text."""
    _WATCH.advise = advise


def describe_interruption(word: str = "interrupted") -> str:
    """Return the sentence of an interrupted run, with how to continue it."""
    advice = _WATCH.advise()
    return f"{word}, {advice}" if advice else word


def ignore_interrupts() -> None:
    """Ignore Ctrl-C: the work is done, and only the process has to end."""
    note_interrupt()
    if _is_command():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _is_command() -> bool:
    """Return whether this process is the command: its script, or ``python -m mbw``."""
    folder, name = os.path.split(os.path.abspath(sys.argv[0] if sys.argv else ""))
    return _COMMAND in (os.path.splitext(name)[0], os.path.basename(folder))


def _start_watch() -> None:
    """Let a thread read the numbers of signals, which arrive whatever the main thread does."""
    reading, writing = socket.socketpair()
    writing.setblocking(False)
    signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
    threading.Thread(
        target=_read_signals, args=(reading, writing), daemon=True, name="signals"
    ).start()


def _read_signals(reading: socket.socket, writing: socket.socket) -> None:
    """End the process on SIGTERM, and on a Ctrl-C that Python does not handle in time.

    Args:
        reading: socket with a byte for each signal.
        writing: its other end, which has to stay open.
    """
    del writing
    while numbers := reading.recv(1):
        number = numbers[0]
        is_interrupt = number == signal.SIGINT
        if number == signal.SIGTERM or (is_interrupt and not _WATCH.is_seen.wait(MAX_DEAF_S)):
            _end(number, None)


def _raise(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, as Python does by itself."""
    note_interrupt()
    signal.default_int_handler(number, frame)


def _end(number: int, frame: FrameType | None) -> None:
    """Say that the command was interrupted, and end the process without unwinding."""
    del frame
    _WATCH.ending.acquire()
    is_terminated = number == signal.SIGTERM
    try:
        text = describe_interruption("terminated" if is_terminated else "interrupted")
        shown = _SHOW_CURSOR if os.isatty(2) else ""
        os.write(2, f"{shown}mbw: {text}\n".encode())
    finally:
        os._exit(TERMINATED if is_terminated else INTERRUPTED)
