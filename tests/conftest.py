"""One BLAS thread in every test, as in the command: two gain nothing and sometimes cost dearly.

Ctrl-C works in every test, also where the suite runs in the background of a shell, which makes its
children ignore it.

Files with the slowest tests come first, so that no worker ends with one of them while others idle.
The slowest tests are listed at the end by the time of their processors, which other work on the
machine changes little. ``CORE_SECONDS=1`` writes that of every file into ``core_seconds.csv``.

``PART`` in the environment chooses files by that table: ``quick`` for an inner loop, ``usual`` for
``make test``, ``long`` for the others, which are whole diagnoses for the most part.

Property tests try 25 examples each; ``make bench ONLY=properties`` tries 200, with the profile that
``HYPOTHESIS_PROFILE`` names.
"""

import csv
import os
import signal
from collections import Counter
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# Before numpy is first imported, and inherited by the commands that tests start.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# The commands that tests start compile the packages once, not each of them anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

settings.register_profile("suite", max_examples=25, deadline=None)
settings.register_profile("full", max_examples=200, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

# Core seconds of each file, as a whole run with ``CORE_SECONDS=1`` found them.
TABLE = Path(__file__).parent / "core_seconds.csv"
# Core seconds of all cheaper files, between which the files of a part lie.
PARTS = {"quick": (-1.0, 300.0), "usual": (-1.0, 1200.0), "long": (1200.0, float("inf"))}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Move the slowest files to the front, and leave out those of another part."""
    folder = Path(__file__).parent
    with TABLE.open(encoding="utf-8", newline="") as stream:
        seconds = {folder / name: float(value) for name, value in csv.reader(stream)}
    items.sort(key=lambda item: -seconds.get(item.path, 0.0))
    if part := os.environ.get("PART"):
        least, most = PARTS[part]
        # By name where the seconds are equal, or each worker would draw the border elsewhere.
        files = sorted({(seconds.get(item.path, 0.0), item.path) for item in items})
        ends = accumulate(value for value, _ in files)
        chosen = {path for (_, path), end in zip(files, ends, strict=True) if least < end <= most}
        items[:] = [item for item in items if item.path in chosen]


LISTED = 20  # slowest tests
USED = "core seconds"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Time the processor of a test, of its fixtures and of the commands that it starts."""
    item.user_properties.append((USED, -sum(os.times()[:4])))
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> Iterator[object]:
    """Add the time since the test began to the report of its end."""
    if call.when == "teardown":
        start = dict(item.user_properties)[USED]
        item.user_properties[:] = [(USED, start + sum(os.times()[:4]))]
    return (yield)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the slowest tests and the time of all."""
    seconds = {
        report.nodeid: dict(report.user_properties).get(USED, 0.0)
        for group in terminalreporter.stats.values()
        for report in group
        if getattr(report, "when", None) == "teardown"
    }
    rows = sorted(((value, name) for name, value in seconds.items()), reverse=True)
    terminalreporter.section(f"{sum(seconds.values()):.0f} core seconds; the slowest tests")
    for value, name in rows[:LISTED]:
        terminalreporter.write_line(f"{value:7.1f} s  {name}")
    if os.environ.get("CORE_SECONDS"):
        of_files: Counter[str] = Counter()
        for value, name in rows:
            of_files[name.partition("::")[0].removeprefix("tests/")] += value
        with TABLE.open("w", encoding="utf-8", newline="") as stream:
            table = csv.writer(stream, lineterminator="\n")
            table.writerows([name, f"{value:.1f}"] for name, value in sorted(of_files.items()))
