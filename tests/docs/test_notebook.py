"""Notebooks of the docs and README's Python: all run as they stand."""

import json
import re

import pytest

import mbworkbench
from tests.docs.notebook import NOTEBOOKS, PLOTLY, ROOT, run_notebook

MISTAKES = [path for path in NOTEBOOKS if path.parent.name == "mistakes"]
README_CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module", params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return request.param, run_notebook(request.param)


def texts(notebook):
    for cell in notebook["cells"]:
        for output in cell.get("outputs", []):
            yield output.get("text") or output["data"]["text/plain"]


def test_saved_outputs_are_those_of_today(notebook):
    path, today = notebook
    saved = json.loads(path.read_text(encoding="utf-8"))
    kinds = [
        [
            [sorted(output.get("data", {"stream": ""})) for output in cell.get("outputs", [])]
            for cell in content["cells"]
        ]
        for content in (saved, today)
    ]
    assert kinds[0] == kinds[1]
    # Numbers may differ in their last digits on another processor; words may not.
    words = [
        [re.sub(r"[\d.e+-]+", "#", text) for text in texts(content)] for content in (saved, today)
    ]
    assert words[0] == words[1]


def test_the_tutorial_says_what_the_model_lacks():
    path = ROOT / "docs" / "tutorial" / "two_bodies.ipynb"
    shown = "\n".join(texts(json.loads(path.read_text(encoding="utf-8"))))
    assert "two_bodies: explained" in shown
    assert "appendage at body:stage ty" in shown


@pytest.mark.parametrize("path", MISTAKES, ids=lambda path: path.stem)
def test_a_page_of_a_mistake_is_short_and_small(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert len(cells) <= 12
    assert path.stat().st_size <= 60_000
    assert any(PLOTLY in str(cell.get("outputs")) for cell in cells)
    assert "How to tell it from" in "".join(cells[-1]["source"])


def test_readmes_python_runs(monkeypatch):
    (code,) = README_CODE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    monkeypatch.chdir(ROOT)
    # The demo takes half a minute; the tutorial's campaign speaks the same language in seconds.
    code = code.replace("assets/demo", "assets/two_bodies").replace("acc11", "acc5")
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    assert names["result"].verdict.verdict == "explained"
    assert set(re.findall(r"\bmb\.(\w+)", code)) <= set(mbworkbench.__all__)
