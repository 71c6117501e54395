"""Ctrl-C for real: a signal to the running command."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(("wait", "presses"), [(3.0, 1), (3.0, 3)])
def test_ctrl_c_keeps_the_best_however_often_it_is_pressed(tmp_path, wait, presses):
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
        process.stderr.readline()  # "demo: 3 tests ...": everything is read, the fit begins
        time.sleep(wait)
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
