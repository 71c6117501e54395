"""One BLAS thread in every test, as in the command: two gain nothing and sometimes cost dearly.

Ctrl-C works in every test, also where the suite runs in the background of a shell, which makes its
children ignore it.

Files with the slowest tests come first, so that no worker ends with one of them while others idle.

Property tests try 25 examples each; ``make bench ONLY=properties`` tries 200, with the profile that
``HYPOTHESIS_PROFILE`` names.
"""

import os
import signal
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
