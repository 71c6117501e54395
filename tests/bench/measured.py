"""Verdicts on real machines that others measured: ``make measured``.

The tower of ``assets/tower``, and where they are at hand the campaigns of ``../shared/real``: the
tower after changes (some with answers, the others sealed) and a suspension. Each verdict is
committed as ``results/measured/<machine>.<campaign>.json``; those that are there are kept, unless
``AGAIN=1``. A changed tower is diagnosed twice: against its drawing, and against the drawing and
its unchanged test (``results/measured/states``). None was ever tuned to. A steering mirror on
piezos, driven at three amplitudes, and a bolted beam, driven to eight levels by stepped sines, have
no model: the check of their levels is committed as ``<machine>.levels.json``.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.bench.kept import only_kept

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = Path(os.environ.get("MEASURED", ROOT.parent / "shared" / "real"))
RESULTS = Path(__file__).parent / "results" / "measured"
STATES = RESULTS / "states"
TOWER = ROOT / "assets" / "tower"
_FLOORS = '["acc1:+x", "acc2:+x", "acc3:+x"]'
_LEVELS = ".levels.json"
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
    for name, write in {"mirror": _write_mirror, "beam": _write_beam}.items():
        target = RESULTS / f"{name}{_LEVELS}"
        folder = FOLDERS / {"mirror": "mirror", "beam": "brb"}[name]
        if folder.is_dir() and not only_kept() and (os.environ.get("AGAIN") or not target.exists()):
            _identify(folder, write, target)
    verdicts = (path for path in sorted(RESULTS.glob("*.json")) if _LEVELS not in path.name)
    return [_row(path) for path in verdicts]


def _identify(source: Path, write, target: Path) -> None:
    """Write the level check of a machine without a model."""
    with tempfile.TemporaryDirectory() as name:
        folder, out = Path(name) / source.name, Path(name) / "out"
        folder.mkdir()
        write(source, folder)
        words = ["identify", folder, "--out", out, "--quiet", "--no-pictures"]
        subprocess.run([sys.executable, "-m", "mbw", *map(str, words)], check=True)
        levels = json.loads((out / "modes.json").read_text(encoding="utf-8"))["levels"]
    target.write_text(json.dumps(levels, indent=1) + "\n", encoding="utf-8")


def _write_mirror(source: Path, folder: Path) -> None:
    """Write the records of three voltages: inputs (input, record, sample), motions beside."""
    tests = []
    for millivolts in (100, 200, 300):
        with np.load(source / f"multisine_{millivolts}mV.npz") as data:
            voltage, motion, rate_hz = (data[key] for key in ("u", "y", "rate_hz"))
        arrays = [
            values.transpose(1, 2, 3, 0).reshape(3, values.shape[2], -1)
            for values in (voltage.astype(float), motion.astype(float))
        ]
        file = folder / f"{millivolts}mV.npz"
        np.savez(file, force=arrays[0], response=arrays[1].swapaxes(0, 1), rate_hz=rate_hz)
        tests.append((file.name, 1e-3 * millivolts, 'quantity = "receptance"\nunit = "m/V"'))
    arms = ((0.01, 0.0), (-0.005, 0.009), (-0.005, -0.009))  # m, of the three actuators
    _write_levels(folder, [(f"acc{k}:+z", arm) for k, arm in enumerate(arms, 1)], tests)
    with (folder / "campaign.toml").open("a", encoding="utf-8") as file:
        file.write('\n[hammer.default]\ngain = "unknown"\n')


def _write_beam(source: Path, folder: Path) -> None:
    """Write the FRFs of stepped sines; the exciter pulls where the accelerometer reads plus."""
    with np.load(source / "stepped_sine_at_8_response_levels.npz") as data:
        freq_hz, force, motion, phase = (
            data[key] for key in ("frequency_hz", "force_n", "acceleration_m_s2", "phase_rad")
        )
    tests = []
    for k, values in enumerate(-motion / force * np.exp(1j * phase)):
        np.savez(folder / f"level{k}.npz", freq_hz=freq_hz[k], frf=values[:, None, None])
        tests.append((f"level{k}.npz", float(force[k].max()), ""))
    _write_levels(folder, [("acc1:+z", (0.0, 0.0))], tests)


def _write_levels(folder: Path, points: list, tests: list) -> None:
    """Write layout and campaign of a body whose points are driven at several levels."""
    layout = "[body.machine]\ncentre = [0.0, 0.0, 0.0]\n"
    for label, (x, y) in points:
        layout += f'[site.{label[:4]}]\nbody = "machine"\nposition = [{x}, {y}, 0.0]\n'
    labels = json.dumps([label for label, _ in points])
    text = 'layout = "layout.toml"\n'
    for file, level, more in tests:
        text += f'\n[[test]]\nfile = "{file}"\nlevel = {level:.4g}\n{more}\n'
        text += f"channels = {labels}\nreferences = {labels}\n"
    (folder / "layout.toml").write_text(layout, encoding="utf-8")
    (folder / "campaign.toml").write_text(text, encoding="utf-8")


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
