"""``mbw identify`` of large hammer tests: core seconds, peak memory, modes found."""

import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from tests.helpers.large_hammer import N_MODES, write_large_test

SIZES = ((69, 3, 801), (150, 6, 3200), (300, 12, 6400))  # channels, references, lines
SEED = 7101


def run() -> list[dict[str, object]]:
    """Identify one test of each size in a process of its own, files and page included."""
    return [_row(*size) for size in SIZES]


def _row(n_out: int, n_in: int, lines: int) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        # In a process of its own: the peak memory of this one would count as that of its children.
        with ProcessPoolExecutor(1) as writer:
            true = writer.submit(write_large_test, place, n_out, n_in, lines, seed=SEED).result()
        command = [sys.executable, "-m", "mbw", "identify", str(place), "--out", str(place / "out")]
        child = subprocess.Popen([*command, "--quiet"])
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise RuntimeError(f"mbw identify ended with {child.returncode}")
        modes = json.loads((place / "out" / "modes.json").read_text("utf-8"))["modes"]
    identified = np.array([[mode["frequency"], mode["damping"]] for mode in modes])
    deviation = np.array([[mode["frequency_sd"], mode["damping_sd"]] for mode in modes])
    # The nearest mode in frequency and damping, each relative.
    nearest = (np.abs(identified[:, None] / true - 1) ** 2 @ [100.0, 1.0]).argmin(axis=0)
    errors = (identified[nearest] - true) / deviation[nearest]
    right = (np.abs(identified[nearest] / true - 1) < [0.01, 0.2]).all(axis=1)
    return {
        "channels": n_out,
        "references": n_in,
        "lines": lines,
        "modes": N_MODES,
        "found": int(right.sum()),
        "extra": len(identified) - int(right.sum()),
        "rms error over deviation": float(np.sqrt((errors[right] ** 2).mean())),
        "core s": used.ru_utime + used.ru_stime,
        "peak GB": used.ru_maxrss / 1e6,
    }
