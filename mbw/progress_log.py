"""Progress as plain lines for a log: stderr is no terminal, so a bar would not be seen."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import Progress, TextColumn

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
