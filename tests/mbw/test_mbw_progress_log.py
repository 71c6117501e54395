"""Progress without a terminal: plain lines with the elapsed time, and none with --quiet."""

import io
import re
import time

from rich.console import Console

import mbw.messages as progress_log
from mbw.messages import ProgressLog, Screen


def screen(quiet=False):
    shown = Screen(quiet=quiet)
    shown.console = Console(file=io.StringIO(), soft_wrap=True, highlight=False, markup=False)
    return shown


def test_a_log_has_a_line_for_each_interval_also_in_a_long_step(monkeypatch):
    monkeypatch.setattr(progress_log, "INTERVAL_S", 0.05)
    shown = screen()
    with shown.progress() as progress:
        assert isinstance(progress, ProgressLog)
        task = progress.add_task("reading", total=6)
        progress.update(task, completed=2, description="stage 3/6: 12 evaluations")
        time.sleep(0.3)
    lines = shown.console.file.getvalue().splitlines()
    assert 2 <= len(lines) <= 8
    assert re.fullmatch(r"  after \d+ s: stage 3/6: 12 evaluations \(2 of 6\)", lines[-1])
    with shown.status("poles"):
        time.sleep(0.3)
    lines = shown.console.file.getvalue().splitlines()
    assert re.fullmatch(r"  after \d+ s: poles", lines[-1])
    count = len(lines)
    time.sleep(0.15)
    assert len(shown.console.file.getvalue().splitlines()) == count, "the thread has ended"


def test_quiet_prints_no_progress(monkeypatch):
    monkeypatch.setattr(progress_log, "INTERVAL_S", 0.02)
    shown = screen(quiet=True)
    with shown.progress() as progress, shown.status("poles"):
        progress.add_task("reading", total=6)
        time.sleep(0.1)
    assert shown.console.file.getvalue() == ""
