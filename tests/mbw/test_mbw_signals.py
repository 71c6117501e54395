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


# The process sends a signal to itself while compiled code is busy for a long time.
DEAF = """
import os, signal, sys, threading
sys.argv = ["mbw", "predict", "model.xml"]
import mbw.command
from mbw.interrupts import advise_at_end, end_on_interrupt, raise_on_interrupt
end_on_interrupt()
raise_on_interrupt()
advise_at_end(lambda: "continue with --resume")
import numpy
matrix = numpy.random.default_rng(0).normal(size=(3000, 3000))
threading.Timer(1.0, os.kill, (os.getpid(), signal.{name})).start()
numpy.linalg.eigvals(matrix)  # tens of seconds in one call of LAPACK
"""


@pytest.mark.parametrize(
    ("name", "code", "word"), [("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")]
)
def test_a_signal_ends_the_command_soon_whatever_compiled_code_does(name, code, word):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    start = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", DEAF.format(name=name)],
        env=environment, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (code, f"mbw: {word}, continue with --resume\n")
    assert time.monotonic() - start < 8.0  # loading, one second, and two seconds at most


def test_sigterm_ends_a_verb_with_one_sentence(tmp_path):
    command = [sys.executable, "-m", "mbw", "tune", str(ROOT / "assets" / "demo"), "--quiet"]
    out = tmp_path / "out"
    with subprocess.Popen(
        [*command, "--out", str(out)], stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, start_new_session=True,
    ) as process:  # fmt: skip
        for _ in range(600):
            if (out / CHECKPOINT_FILE).is_file() or process.poll() is not None:
                break
            time.sleep(0.1)
        process.terminate()
        errors = process.stderr.read()
    assert process.returncode == 143
    assert errors.startswith("mbw: terminated, continue with --resume: finished steps are kept (")
