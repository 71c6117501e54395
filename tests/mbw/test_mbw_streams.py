"""Standard streams that are closed, full or no longer read; Ctrl-C while Python loads."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "assets" / "two_bodies.xml"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
COMMAND = f"{sys.executable} -m mbw"
PREDICT = f"{COMMAND} predict {MODEL} --no-pictures"
# Sends Ctrl-C to itself as soon as a module is looked for, while the command loads.
INTERRUPT_AT = f"""
import os, signal, sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)

module = sys.argv[1]
sys.meta_path.insert(0, Finder())
sys.argv = ["mbw", "diagnose", {str(ROOT / "assets" / "demo")!r}]
from mbw.command import main
main()
"""


def shell(line, folder):
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        capture_output=True, text=True, env=ENVIRONMENT, cwd=folder, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        (f"{PREDICT} --json - >/dev/full", 3, "No space left on device"),
        (f"{PREDICT} --json - >&-", 3, "Bad file descriptor"),
        (f"{PREDICT} --json /dev/full", 3, "/dev/full cannot be written (No space left"),
        (f"{PREDICT} | head -c0", 0, ""),
        (f"{PREDICT} 2>&- | grep -c Hz", 0, ""),
        (f"{COMMAND} predict none.xml 2>/dev/full", 3, ""),
        (f"{COMMAND} predict none.xml 2>&-", 3, ""),
        (f"{COMMAND} --help >/dev/full", 3, "stdout cannot be written (No space left on device)"),
        (f"{COMMAND} --help | head -c0", 0, ""),
    ],
)
def test_a_stream_that_fails_is_no_internal_error(tmp_path, line, code, message):
    done = shell(line, tmp_path)
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == (1 if message else 0), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_file_never_gets_the_number_of_a_closed_stream(tmp_path):
    done = shell(f"{PREDICT} --json modes.json >&- 2>&- <&-", tmp_path)
    assert done.returncode == 3  # the table for stdout is lost
    text = (tmp_path / "modes.json").read_text()
    assert text.startswith("{")
    assert text.endswith("}\n")


@pytest.mark.parametrize("module", ["typer", "mbw.messages", "numpy", "mujoco", "diagnosis"])
def test_ctrl_c_while_modules_load_ends_quietly(tmp_path, module):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPT_AT, module],
        capture_output=True, text=True, env=ENVIRONMENT, cwd=tmp_path, check=False,
    )  # fmt: skip
    assert done.returncode == 130
    assert done.stderr == "mbw: interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_the_parents_of_other_programs_keep_their_handler():
    code = (
        "import signal, mbw.command; "
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    )
    subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=True)
