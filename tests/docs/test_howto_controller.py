"""The pages that design controllers: their code runs, and prints what the page says."""

import re

import pytest

from tests.docs.results import ROOT

PAGES = ROOT / "docs" / "howto"
BLOCK = re.compile(r"^```(python|text)\n(.*?)^```", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.mark.parametrize(
    ("page", "count"), [("design_a_controller.md", 5), ("robust_controller.md", 3)]
)
def test_the_page_prints_what_it_says(page, count, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names = {}
    blocks = BLOCK.findall((PAGES / page).read_text(encoding="utf-8"))
    assert [kind for kind, _ in blocks].count("text") == count
    for kind, content in blocks:
        if kind == "python":
            exec(compile(content, page, "exec"), names)
            continue
        printed = capsys.readouterr().out
        assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", content).split()
        stated = [float(text) for text in NUMBER.findall(content)]
        # Digits of another processor; the growth of a nearly stable pole has fewest.
        assert [float(text) for text in NUMBER.findall(printed)] == pytest.approx(stated, rel=0.02)
