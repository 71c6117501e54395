"""``mbw tune`` in a process of its own, killed at a moment and resumed."""

import hashlib
import json
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truth import Plan, Protocol, draw_campaign, write_campaign
from truth.machine.random_tree import draw_tree
from tuning import CHECKPOINT_FILE

COMMAND = [sys.executable, "-m", "mbw", "tune", "--starts", "2", "--quiet"]


@dataclass(frozen=True)
class Killed:
    """What a killed and resumed run left.

    Args:
        killed: whether the signal came before the end.
        steps: finished steps that it found.
        bits: hashes of the results.
    """

    killed: bool
    steps: int
    bits: dict[str, str]


def campaign_in(folder: Path, seed: int) -> Path:
    """A campaign of a small random machine."""
    tree = draw_tree(seed, 2)
    protocol = Protocol(nodes=(tree.first_aim(),), lines=81, resolution_hz=2.0)
    write_campaign(draw_campaign(tree, Plan(seed, protocol=protocol)), folder / "campaign")
    return folder / "campaign"


def whole(campaign: Path, out: Path) -> tuple[dict[str, str], float]:
    """Hashes of the results of a run that nobody disturbs, and its seconds."""
    begin = time.monotonic()
    subprocess.run([*COMMAND, str(campaign), "--out", str(out)], check=True)
    return _bits(out), time.monotonic() - begin


def killed_and_resumed(
    campaign: Path, out: Path, seconds: float = np.inf, steps: float = np.inf
) -> Killed:
    """Kill a run after some seconds or finished steps, if it still runs; resume it to its end."""
    command = [*COMMAND, str(campaign), "--out", str(out)]
    begin, process = time.monotonic(), subprocess.Popen(command)
    while process.poll() is None:
        if time.monotonic() - begin >= seconds or _finished(out) >= steps:
            process.kill()
        time.sleep(0.002)
    found = _finished(out)
    subprocess.run([*command, "--resume"], check=True)
    return Killed(process.returncode == -signal.SIGKILL, found, _bits(out))


def _finished(out: Path) -> int:
    kept = out / CHECKPOINT_FILE
    return len(json.loads(kept.read_text())["steps"]) if kept.is_file() else 0


def _bits(out: Path) -> dict[str, str]:
    bits = {
        name: hashlib.sha256((out / name).read_bytes()).hexdigest()
        for name in ("tuned.json", "tuned.xml")
    }
    with np.load(out / "frf.npz") as arrays:
        for name in arrays.files:
            bits[name] = hashlib.sha256(arrays[name].tobytes()).hexdigest()
    return bits
