"""Interruption of the running command by a signal (Ctrl-C)."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tuning.fitting.checkpoint import CHECKPOINT_FILE

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("presses", [1, 3])
def test_ctrl_c_keeps_the_best_however_often_it_is_pressed(tmp_path, presses):
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "mbw",
        "tune",
        str(ROOT / "assets" / "demo"),
        "--out",
        str(out),
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    ) as process:
        for _ in range(600):  # until something was found, however slow the machine is
            if (out / CHECKPOINT_FILE).is_file() or process.poll() is not None:
                break
            time.sleep(0.1)
        for _ in range(presses):
            os.killpg(process.pid, signal.SIGINT)
            time.sleep(0.3)
        errors = process.stderr.read()
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    summary = json.loads((out / "tuned.json").read_text())
    assert summary["interrupted"] is True
    gap = summary["gap"]["sensors"]
    assert gap["held_out"] is None
    assert gap["tuned"]["error"] < gap["as_drawn"]["error"]
