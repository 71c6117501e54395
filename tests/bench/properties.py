"""Property tests with many examples: 200 for each, where the test suite tries 25."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROFILE = "full"


def run() -> list[dict[str, object]]:
    """Run every test that hypothesis drives; return how many passed and failed."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "2", "-m", "hypothesis", "tests"],
        cwd=ROOT,
        env={**os.environ, "HYPOTHESIS_PROFILE": PROFILE},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    counts = dict.fromkeys(("passed", "failed", "error"), 0)
    for number, word in re.findall(r"(\d+) (passed|failed|error)", done.stdout.splitlines()[-1]):
        counts[word] = int(number)
    if not counts["passed"]:
        raise RuntimeError(f"no property test ran: {done.stdout[-2000:]}")
    return [{"examples": 200, **counts}]
