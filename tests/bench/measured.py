"""Verdicts on real machines that others measured: ``make measured``.

The tower of ``assets/tower``, and where they are at hand the campaigns of ``../shared/real``: the
tower after changes (some with answers, the others sealed) and a suspension. Each verdict is
committed as ``results/measured/<machine>.<campaign>.json``; those that are there are kept, unless
``AGAIN=1``. ``results/measured/before`` has verdicts of the engine that knew no reciprocity. None
was ever tuned to.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.bench.kept import only_kept

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = Path(os.environ.get("MEASURED", ROOT.parent / "shared" / "real"))
RESULTS = Path(__file__).parent / "results" / "measured"
_CAUSES, _MIN_PROBABILITY = 3, 0.1  # that a row states


def run() -> list[dict[str, object]]:
    """Diagnose what is missing; return a row for each campaign."""
    RESULTS.mkdir(exist_ok=True)
    for name, folder in _campaigns().items():
        target = RESULTS / f"{name}.json"
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
    campaigns = {"tower.unchanged": ROOT / "assets" / "tower"}
    for group, (folder, names) in groups.items():
        for path in sorted((FOLDERS / folder).glob("*/campaign.toml")):
            if names is None or path.parent.name in names:
                campaigns[f"{group}.{path.parent.name}"] = path.parent
    return campaigns


def _diagnose(folder: Path, target: Path) -> None:
    """Write the verdict on a campaign."""
    with tempfile.TemporaryDirectory() as out:
        words = ["diagnose", folder, "--out", Path(out) / "out", "--json", target, "--quiet"]
        subprocess.run([sys.executable, "-m", "mbw", *map(str, words)], check=False)


def _row(path: Path) -> dict[str, object]:
    """Return verdict, causes and, where it is known, the answer."""
    before = path.parent / "before" / path.name
    return {
        "campaign": path.stem,
        "before": _describe(before) if before.exists() else "",
        "now": _describe(path),
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
