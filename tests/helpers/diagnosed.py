"""A folder that ``mbw diagnose`` left, of a small campaign of truth."""

import importlib
import re
import shutil
from html import unescape
from pathlib import Path

import pytest
from drawn import drawn
from typer.testing import CliRunner

from diagnosis import EFFECTS
from mbw.command import app

RUNNER = CliRunner()
LINES = 161
DIAGNOSE = importlib.import_module("diagnosis.algorithm")  # the package has a function of that name
CASES: dict[str, tuple[int, str | None, float | None, str | None]] = {
    # seed, effect, survival ratio, what the catalogue knows
    "none": (72_010, None, None, None),
    "explained": (72_013, "gyroscopic", 6.0, None),
    "unexplained": (72_013, "gyroscopic", 6.0, "drift"),
    "sensor": (72_011, "sensor_polarity", None, "sensor_polarity"),
}


def diagnosed(name: str, folder: Path) -> Path:
    """Diagnose one of the cases; what nobody explains by a catalogue that knows too little."""
    seed, effect, ratio, known = CASES[name]
    drawn(folder, seed, effect, ratio=ratio, lines=LINES)
    result = folder / "result"
    with pytest.MonkeyPatch.context() as patch:
        if known is not None:
            patch.setattr(DIAGNOSE, "catalogue", lambda: {known: EFFECTS[known]})
        outcome = RUNNER.invoke(app, ["diagnose", str(folder / "campaign"), "--out", str(result)])
    assert outcome.exit_code == 0, outcome.stderr
    assert (result / "report.html").as_uri() in outcome.stderr
    shutil.rmtree(folder / "campaign")  # all that follows needs the result alone
    return result


def lead_of(page: str) -> str:
    """The first sentences of a page, without the explanations of their words."""
    found = re.search(r'<p class="lead">(.*?)</p>', page, re.DOTALL)
    assert found is not None
    return unescape(plain(found[1]))


def plain(page: str) -> str:
    """A page without the explanations of its words."""
    return re.sub(r"</?abbr[^>]*>", "", page)
