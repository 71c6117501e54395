"""A folder that ``mbw diagnose`` left, of a small campaign of truth."""

import atexit
import re
import shutil
import tempfile
from functools import cache
from html import unescape
from pathlib import Path

import pytest
from drawn import drawn
from typer.testing import CliRunner

from diagnosis import EFFECTS
from diagnosis.search import refit_round
from mbw.command import app

RUNNER = CliRunner()
LINES = 161
CASES: dict[str, tuple[int, tuple[str, ...], float | None, str | None]] = {
    # seed, effects, survival ratio, what the catalogue knows
    "none": (72_010, (), None, None),
    "explained": (72_013, ("gyroscopic",), 6.0, None),
    "partly": (72_014, ("parallel_path", "appendage"), (20.0, 4.0), "parallel_path"),
    "unexplained": (72_013, ("gyroscopic",), 6.0, "drift"),
    "sensor": (72_011, ("sensor_polarity",), None, "sensor_polarity"),
}


def diagnosed(name: str, folder: Path) -> Path:
    """Return the result of one of the cases in a folder; each case is diagnosed once."""
    return shutil.copytree(_diagnose_case(name), folder / "result")


@cache
def _diagnose_case(name: str) -> Path:
    """Diagnose a case; what nobody explains by a catalogue that knows too little."""
    seed, effects, ratio, known = CASES[name]
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    drawn(folder, seed, *effects, ratio=ratio, lines=LINES)
    result = folder / "result"
    with pytest.MonkeyPatch.context() as patch:
        if known is not None:
            patch.setattr(refit_round, "load_catalogue", lambda: {known: EFFECTS[known]})
        outcome = RUNNER.invoke(app, ["diagnose", str(folder / "campaign"), "--out", str(result)])
    assert outcome.exit_code == 0, outcome.stderr
    assert (result / "report.html").as_uri() in outcome.stderr
    shutil.rmtree(folder / "campaign")  # all that follows needs the result alone
    return result


def diagnose_rotor(place):
    """Folder of mbw diagnose of a machine with a spinning rotor that its drawing lacks."""
    drawn(place, 72_013, "gyroscopic", ratio=6.0, lines=161)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(refit_round, "load_catalogue", lambda: {"gyroscopic": EFFECTS["gyroscopic"]})
        words = ["diagnose", str(place / "campaign"), "--out", str(place / "result"), "--quiet"]
        run = RUNNER.invoke(app, words)
    assert run.exit_code in (0, 4), run.output
    return place / "result"


def lead_of(page: str) -> str:
    """The first sentences of a page, without the explanations of their words."""
    found = re.search(r'<p class="lead">(.*?)</p>', page, re.DOTALL)
    assert found is not None
    return unescape(plain(found[1]))


def plain(page: str) -> str:
    """A page without the explanations of its words."""
    return re.sub(r"</?abbr[^>]*>", "", page)
