"""Campaigns and results of the gallery's machines: drawn, tuned, diagnosed and predicted.

What a machine hides stands in ``assets/gallery/gallery.toml``. A campaign and a diagnosis that
exist are kept if their inputs are those of now: the row of the table, the model and the test.
"""

import hashlib
import json
import os
import shutil
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits
from typer.testing import CliRunner

from diagnosis import Verdict
from mbmodel import mjcf_files
from mbw.command import app
from mbw.demo.verb import grade_verdict
from mbw.gallery import find_part, read_gallery
from mbw.results.diagnosed_files import PAGE
from tests.docs.results import ROOT
from truth import Cause, Plan, Protocol, VirtualCampaign, Wanted, draw_campaign, read_station
from truth import fit_to_machine as fit_band
from truth.campaign.draw import REAL_INSTRUMENTS
from tuning import open_session
from tuning.files.plant_folder import ARRAYS, VERDICT

GALLERY = ROOT / "assets" / "gallery"
WORK = ROOT / "build" / "gallery"  # tunings, predictions and pages: they are not committed
RECORD = "gallery.json"
LINES, AVERAGES, CORRECTIONS = 301, 10, 3  # of a drawn test, and of the size of its effect
PLAYED_EVERY = 2  # line of a played test is kept
NOT_CONVERGED = 4
CURVES = ("measured", "retuned", "after", "corrected", "noise")  # arrays of diagnosis.npz
DROPPED_BITS = 12  # of 23: curves stay within 2.4e-4, and their file is a third smaller


class GalleryMachine:
    """A machine of the gallery with its files.

    Args:
        name: of its row in the table.
    """

    def __init__(self, name: str) -> None:
        self.name, self.row = name, read_gallery()[name]
        self.model = (GALLERY / self.row["model"]).resolve()
        self.campaign = (GALLERY / self.row.get("campaign", name)).resolve()
        self.diagnosed = find_part(name, "diagnosed")

    @property
    def is_measured(self) -> bool:
        """Whether the test is a real one."""
        return "campaign" in self.row

    @property
    def verdict(self) -> Verdict:
        """Committed verdict."""
        return Verdict.model_validate_json((self.diagnosed / VERDICT).read_text("utf-8"))

    @property
    def record(self) -> Mapping[str, Any]:
        """Record of the full run; empty before it."""
        path = self.diagnosed / RECORD
        return json.loads(path.read_text("utf-8")) if path.is_file() else {}

    @cached_property
    def answer(self) -> Mapping[str, Any]:
        """Hidden effect, place and sizes, by answer.toml; empty for a measured machine."""
        path = self.campaign / "answer.toml"
        return tomllib.loads(path.read_text("utf-8")) if path.is_file() else {}

    def grade(self) -> list[str]:
        """Return lines that compare the committed verdict with the answer."""
        return grade_verdict(self.verdict, self.answer) if self.answer else []

    def hash_inputs(self) -> str:
        """Return the hash of the row, the files of the model, and those of a measured test."""
        files = [self.model, *map(Path, mjcf_files(self.model))]
        if "play" in self.row:
            files.append(GALLERY / self.row["play"]["truth"])
        if self.is_measured:
            files += sorted(path for path in self.campaign.iterdir() if path.suffix != ".md")
        said = {key: self.row[key] for key in ("draw", "play") if key in self.row}
        whole = hashlib.sha256(json.dumps(said, sort_keys=True).encode())
        for path in sorted(set(files)):
            whole.update(path.read_bytes())
        return whole.hexdigest()

    def draw(self) -> VirtualCampaign:
        """Draw the campaign of a machine that hides an effect of ``truth``."""
        drawn = self.row["draw"]
        station = read_station(self.model)
        protocol = replace(
            fit_band(Protocol((drawn["node"],), averages=AVERAGES), station),
            lines=drawn.get("lines", LINES),
            resolution_hz=drawn["resolution_hz"],
            levels=(drawn["level"],),
        )
        wanted = Wanted(drawn["effect"], drawn.get("place"), drawn.get("ratio"), CORRECTIONS)
        plan = Plan(drawn["seed"], Cause((wanted,)), protocol, REAL_INSTRUMENTS, as_drawn=True)
        with threadpool_limits(1):  # more threads round otherwise: the bytes would be others
            return draw_campaign(station, plan)

    def write_campaign(self) -> None:
        """Write campaign.toml, measurements and answer; the model stays where it is."""
        if self.is_measured:
            return
        self.campaign.mkdir(exist_ok=True)
        if "play" in self.row:
            self._play()
            return
        campaign = self.draw()
        for name, content in campaign.files.items():
            if name.endswith(".uff"):
                (self.campaign / name).write_bytes(content)
        self._write_settings(campaign.files["campaign.toml"].decode())
        (self.campaign / "answer.toml").write_bytes(campaign.answer)

    def _write_settings(self, text: str) -> None:
        """Write campaign.toml with the path of the one model."""
        path = Path(os.path.relpath(self.model, self.campaign)).as_posix()
        lines = [f'model = "{path}"' if t.startswith("model = ") else t for t in text.splitlines()]
        (self.campaign / "campaign.toml").write_text("\n".join(lines) + "\n", "utf-8")

    def _play(self) -> None:
        """Hit the true machine in MuJoCo, and keep the FRFs of its records."""
        played, folder = self.row["play"], WORK / f"{self.name}-played"
        words = ["simulate", str(GALLERY / played["truth"]), "--nominal", str(self.model)]
        words += [word for point in played["hammer"] for word in ("--hammer", point)]
        words += ["--hits", str(played["hits"]), "--seed", str(played["seed"])]
        words += ["--level", str(played["level"])] if "level" in played else []
        words += ["--block", str(played["block"]), "--no-pictures"]
        run_verb(*words, "--out", str(folder), "--overwrite")
        campaign = open_session(folder).campaign  # on the lines with coherence
        frfs = [test.estimate for test in campaign.tests]
        freq_hz = campaign.freq_hz
        kept = np.flatnonzero(freq_hz <= played.get("highest", freq_hz[-1]))[::PLAYED_EVERY]
        np.savez(
            self.campaign / "impact.npz",
            freq_hz=freq_hz[kept],
            frf=np.concatenate([f.frf.values[kept] for f in frfs], axis=2).astype(np.complex64),
            coherence=np.concatenate([f.coherence[kept] for f in frfs], axis=2).astype(np.float32),
        )
        text = (folder / "campaign.toml").read_text("utf-8")
        (records,) = folder.glob("hits_*.npz")
        stated = f'\nunit = "m/s^2/N"\nwindow_tau = {frfs[0].window_tau!r}'
        text = text.replace(records.name, "impact.npz").replace(
            quantity := 'quantity = "accelerance"', quantity + stated
        )
        self._write_settings(text)
        answer = f'effect = "{played["effect"]}"\nlocation = "{played["location"]}"\n'
        (self.campaign / "answer.toml").write_text(answer, "utf-8")

    def run(self) -> None:
        """Make campaign, tuning, diagnosis and prediction, and note what they say."""
        tuned, predicted = (WORK / f"{self.name}-{suffix}" for suffix in ("tuned", "predicted"))
        self.write_campaign()
        shutil.rmtree(self.diagnosed, ignore_errors=True)
        run_verb("tune", str(self.campaign), "--out", str(tuned), "--overwrite")
        run_verb("diagnose", str(self.campaign), "--out", str(self.diagnosed), "--overwrite")
        shutil.move(self.diagnosed / PAGE, WORK / f"{self.name}-{PAGE}")
        run_verb("predict", str(self.diagnosed), "--out", str(predicted), "--overwrite")
        shorten_curves(self.diagnosed / ARRAYS)
        record = {"inputs": self.hash_inputs()}
        (self.diagnosed / RECORD).write_text(json.dumps(record, indent=1) + "\n", "utf-8")


def shorten_curves(path: Path) -> None:
    """Round the curves of a diagnosis, so that they are packed into less."""
    with np.load(path) as file:
        arrays = dict(file)
    for name in CURVES:
        if arrays[name].size:
            bits = np.ascontiguousarray(arrays[name]).view(np.uint32) + 2 ** (DROPPED_BITS - 1)
            arrays[name] = (bits >> DROPPED_BITS << DROPPED_BITS).view(arrays[name].dtype)
    np.savez_compressed(path, **arrays)


def run_verb(*words: str) -> None:
    """Run the command in this process; a fit that did not converge still has its results."""
    run = CliRunner().invoke(app, [*words, "--quiet"])
    if run.exit_code not in (0, NOT_CONVERGED):
        raise RuntimeError(f"mbw {' '.join(words)} ended with {run.exit_code}: {run.output}")


def gallery_machines() -> list[GalleryMachine]:
    """Return all machines of the gallery."""
    return [GalleryMachine(name) for name in read_gallery()]
