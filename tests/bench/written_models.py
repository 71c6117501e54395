"""Written models read back: random trees with compiler settings, defaults and includes, and files.

Each row writes a machine whose parameters were all moved, reads the file, and compares mass,
damping and stiffness matrices with those in memory, by MuJoCo's own mass matrix too. Assets and, if
they are there, the models of ``../shared`` follow the trees. In the environment: ``COUNT=50``.
"""

import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from identification.words import WorkbenchError
from mbmodel import held_parameters, load_machine, write_model
from tests.helpers.written_machines import compare_with_mujoco, moved_model, random_machine

NAME, SEED, EXACT = "written_models", 462_000, 1e-9
ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (ROOT / "assets", ROOT.parent / "shared")


def run() -> list[dict[str, object]]:
    """Return a row for each written machine: largest difference, core seconds, whether it holds."""
    return list(_rows())


def _rows() -> Iterator[dict[str, object]]:
    for number in range(int(os.environ.get("COUNT", "50"))):
        with tempfile.TemporaryDirectory() as folder:
            path = random_machine(SEED + number, Path(folder))
            yield _compare(f"tree {SEED + number}", path, SEED + number)
    for folder in FOLDERS:
        for path in sorted([*folder.rglob("*.xml"), *folder.rglob("*.urdf")]):
            try:
                load_machine(path)
            except WorkbenchError:
                continue  # no machine, or refused by name
            yield _compare(str(path.relative_to(folder.parent)), path, 1)


def _compare(name: str, path: Path, seed: int) -> dict[str, object]:
    model, theta = moved_model(path, seed)
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "tuned.xml"
        start = time.process_time()
        written = write_model(model, theta, target)
        seconds = time.process_time() - start
        statics = load_machine(path, follow=True).statics
        following = replace(model, machine=replace(model.machine, statics=statics))
        difference = compare_with_mujoco(following, held_parameters(model, theta), target)
    return {
        "machine": name,
        "difference": difference,
        "seconds": round(seconds, 2),
        "right": not written.difference and difference < EXACT,
    }
