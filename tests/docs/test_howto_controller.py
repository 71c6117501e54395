"""The page that designs a controller: its code runs, and prints what the page says."""

import re

import pytest

from tests.docs.results import ROOT

PAGE = ROOT / "docs" / "howto" / "design_a_controller.md"
BLOCK = re.compile(r"^```(python|text)\n(.*?)^```", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def test_the_page_prints_what_it_says(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names = {}
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    assert [kind for kind, _ in blocks].count("text") == 5
    for kind, content in blocks:
        if kind == "python":
            exec(compile(content, PAGE.name, "exec"), names)
            continue
        printed = capsys.readouterr().out
        assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", content).split()
        stated = [float(text) for text in NUMBER.findall(content)]
        # Digits of another processor; the growth of a nearly stable pole has fewest.
        assert [float(text) for text in NUMBER.findall(printed)] == pytest.approx(stated, rel=0.02)
