"""One BLAS thread in every test, as in the command: two gain nothing and sometimes cost dearly.

Ctrl-C works in every test, also where the suite runs in the background of a shell, which makes its
children ignore it.

Files with the slowest tests come first, so that no worker ends with one of them while others idle.
The slowest tests are listed at the end by the time of their processors, which other work on the
machine does not change; ``CPU_TIMES=file.csv`` writes that of every test.

Property tests try 25 examples each; ``make bench ONLY=properties`` tries 200, with the profile that
``HYPOTHESIS_PROFILE`` names.
"""

import csv
import os
import signal
from collections.abc import Iterator
from pathlib import Path

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# Before numpy is first imported, and inherited by the commands that tests start.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

settings.register_profile("suite", max_examples=25, deadline=None)
settings.register_profile("full", max_examples=200, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

# Files of half a minute and more on an idle core, the slowest first.
SLOWEST_FILES = (
    "mbw/test_mbw_blind.py",
    "diagnosis/test_diagnosis_level_verdicts.py",
    "mbw/test_mbw_blind_further.py",
    "mbw/test_mbw_demo.py",
    "identification/test_identification_solid_faults.py",
    "diagnosis/test_diagnosis_selection.py",
    "identification/test_identification_solid_body_check.py",
    "identification/test_identification_solid_shared_shape.py",
    "diagnosis/test_diagnosis_references.py",
    "mbw/test_mbw_diagnose_page.py",
    "field/test_field.py",
    "test_fuzz_files.py",
    "diagnosis/test_diagnosis_dirty_machines.py",
    "mbw/test_mbw_blind_campaign.py",
    "diagnosis/test_diagnosis_catalogue.py",
    "truth/test_truth_case_design.py",
    "mbw/test_mbw_identify_roving.py",
    "tuning/test_tuning_coverage.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Move the tests of the slowest files to the front, file by file."""
    ranks = {Path(__file__).parent / name: rank for rank, name in enumerate(SLOWEST_FILES)}
    missing = [str(path) for path in ranks if not path.is_file()]
    if missing:
        raise pytest.UsageError(f"tests/conftest.py: SLOWEST_FILES names no file: {missing}")
    items.sort(key=lambda item: ranks.get(item.path, len(ranks)))


LISTED = 20  # slowest tests
CPU_SECONDS = "cpu_seconds"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Time the processor of a test, of its fixtures and of the commands that it starts."""
    item.user_properties.append((CPU_SECONDS, -sum(os.times()[:4])))
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> Iterator[object]:
    """Add the time since the test began to the report of its end."""
    if call.when == "teardown":
        start = dict(item.user_properties)[CPU_SECONDS]
        item.user_properties[:] = [(CPU_SECONDS, start + sum(os.times()[:4]))]
    return (yield)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the slowest tests and the time of all."""
    seconds = {
        report.nodeid: dict(report.user_properties).get(CPU_SECONDS, 0.0)
        for group in terminalreporter.stats.values()
        for report in group
        if getattr(report, "when", None) == "teardown"
    }
    rows = sorted(((value, name) for name, value in seconds.items()), reverse=True)
    terminalreporter.section(f"{sum(seconds.values()):.0f} core seconds; the slowest tests")
    for value, name in rows[:LISTED]:
        terminalreporter.write_line(f"{value:7.1f} s  {name}")
    if file := os.environ.get("CPU_TIMES"):
        with open(file, "w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerows(rows)
