"""Verdicts on real machines that others measured: ``make measured``.

The tower of ``assets/tower``, and where they are at hand the campaigns of ``../shared/real``: the
tower after changes (some with answers, the others sealed) and a suspension. Each verdict is
committed as ``results/measured/<machine>.<campaign>.json``; those that are there are kept, unless
``AGAIN=1``. A changed tower is diagnosed twice: against its drawing, and against the drawing and
its unchanged test (``results/measured/states``). None was ever tuned to.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.bench.kept import only_kept

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = Path(os.environ.get("MEASURED", ROOT.parent / "shared" / "real"))
RESULTS = Path(__file__).parent / "results" / "measured"
STATES = RESULTS / "states"
TOWER = ROOT / "assets" / "tower"
_FLOORS = '["acc1:+x", "acc2:+x", "acc3:+x"]'
_CAUSES, _MIN_PROBABILITY = 3, 0.1  # that a row states


def run() -> list[dict[str, object]]:
    """Diagnose what is missing; return a row for each campaign."""
    STATES.mkdir(exist_ok=True, parents=True)
    for name, folder in _campaigns().items():
        targets = [RESULTS / f"{name}.json"]
        if name.startswith(("tower.open.", "tower.sealed.")):
            targets.append(STATES / f"{name}.json")
        for target in targets:
            if not only_kept() and (os.environ.get("AGAIN") or not target.exists()):
                _diagnose(folder, target)
    return [_row(path) for path in sorted(RESULTS.glob("*.json"))]


def _campaigns() -> dict[str, Path]:
    """Return the campaigns that are at hand, by the name of their verdict."""
    groups = {
        "suspension": ("kagra", ("clean", "focus")),
        "tower.open": ("tower/open", None),
        "tower.sealed": ("tower/sealed", None),
    }
    campaigns = {"tower.unchanged": TOWER}
    for group, (folder, names) in groups.items():
        for path in sorted((FOLDERS / folder).glob("*/campaign.toml")):
            if names is None or path.parent.name in names:
                campaigns[f"{group}.{path.parent.name}"] = path.parent
    return campaigns


def _diagnose(folder: Path, target: Path) -> None:
    """Write the verdict on a campaign, for ``STATES`` beside the unchanged tower."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        if target.parent == STATES:
            folder = _join_states(folder, Path(name) / folder.name)
        words = ["diagnose", folder, "--out", out, "--json", target, "--quiet"]
        subprocess.run([sys.executable, "-m", "mbw", *map(str, words)], check=False)


def _join_states(after: Path, folder: Path) -> Path:
    """Write a campaign of the unchanged tower, and of a changed one; return its folder."""
    folder.mkdir()
    tests = []
    for state, file in (("before", TOWER / "accelerance.npz"), ("after", after / "frf.npz")):
        shutil.copy(file, folder / f"{state}.npz")
        tests.append(
            f'[[test]]\nfile = "{state}.npz"\nstate = "{state}"\nquantity = "accelerance"\n'
            f'unit = "m/s^2/N"\nchannels = {_FLOORS}\nreferences = {_FLOORS}\n'
        )
    shutil.copy(TOWER / "model.xml", folder)
    text = 'model = "model.xml"\nignore_hz = [[0, 2], [60, 128]]\n' + "".join(tests)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


def _row(path: Path) -> dict[str, object]:
    """Return verdict, causes and, where it is known, the answer."""
    both = STATES / path.name
    return {
        "campaign": path.stem,
        "one state": _describe(path),
        "before and after": _describe(both) if both.exists() else "",
        "answer": ", ".join(_answer(path.stem)),
    }


def _describe(path: Path) -> str:
    """Return the verdict and the most probable causes."""
    verdict = json.loads(path.read_text(encoding="utf-8"))
    causes = [
        f"{cause['effect']}@{cause['location']} {cause['probability']:.2f}"
        for cause in verdict["causes"][:_CAUSES]
        if (cause["probability"] or 0.0) >= _MIN_PROBABILITY
    ]
    return f"{verdict['verdict']}: {', '.join(causes)}" if causes else verdict["verdict"]


def _answer(name: str) -> list[str]:
    """Return the true changes of an open campaign; nothing for others."""
    file = FOLDERS / "tower" / "open" / "answers.json"
    if not name.startswith("tower.open.") or not file.exists():
        return []
    answers = json.loads(file.read_text(encoding="utf-8"))[name.removeprefix("tower.open.")]
    return [f"{each['effect']}@{each['location']}" for each in answers] or ["nothing"]
