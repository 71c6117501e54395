"""Pages whose commands are run one after the other: they print what the page says."""

import re
import shutil

import pytest
from typer.testing import CliRunner

from mbw.command import app
from tests.docs.results import ROOT

PAGE, ASSETS = ROOT / "docs" / "tutorial" / "your_own_machine.md", ROOT / "assets" / "axis"
BLOCK = re.compile(r"^ *```(xml|text|)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def holds(printed, stated):
    """Whether a printed line is a stated one, but for digits of another processor."""
    if NUMBER.sub("#", printed).split() != NUMBER.sub("#", stated).split():
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(stated), strict=True)
    return all(float(a) == pytest.approx(float(b), rel=0.03, abs=2e-4) for a, b in pairs)


def test_the_commands_from_drawing_to_controller_print_what_the_page_says(tmp_path, monkeypatch):
    shutil.copytree(ASSETS, tmp_path / "my-axis")
    monkeypatch.chdir(tmp_path / "my-axis")
    model = {" ".join(line.split()) for line in (ASSETS / "axis.xml").read_text().splitlines()}
    printed, calls = [], 0
    for kind, content in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        lines = [line for line in content.splitlines() if line.strip()]
        if kind == "xml":
            assert {" ".join(line.split()) for line in lines} <= model
        elif kind == "text":
            missing = [line for line in lines if not any(holds(each, line) for each in printed)]
            assert not missing, "\n".join(printed)
        for words in (line.split() for line in lines if not kind and line.startswith("mbw ")):
            done = CliRunner().invoke(app, words[1:])
            assert done.exit_code == 0, done.output
            printed, calls = done.output.splitlines(), calls + 1
    assert calls == 8
