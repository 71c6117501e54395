"""The tutorial's notebook and README's Python: both run as they stand."""

import json
import re

import pytest

import mbworkbench
from tests.docs.notebook import NOTEBOOK, PLOTLY, ROOT, run_notebook

README_CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def notebook():
    return run_notebook()


def texts(notebook):
    for cell in notebook["cells"]:
        for output in cell.get("outputs", []):
            yield output.get("text") or output["data"]["text/plain"]


def test_the_notebook_runs_and_finds_what_the_model_lacks(notebook):
    shown = "\n".join(texts(notebook))
    assert "two_bodies: explained" in shown
    assert "appendage at body:stage ty" in shown
    assert sum(PLOTLY in str(cell.get("outputs")) for cell in notebook["cells"]) == 4


def test_its_saved_outputs_are_those_of_today(notebook):
    saved = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    kinds = [
        [
            [sorted(output.get("data", {"stream": ""})) for output in cell.get("outputs", [])]
            for cell in content["cells"]
        ]
        for content in (saved, notebook)
    ]
    assert kinds[0] == kinds[1]
    # Numbers may differ in their last digits on another processor; words may not.
    words = [
        [re.sub(r"[\d.e+-]+", "#", text) for text in texts(content)]
        for content in (saved, notebook)
    ]
    assert words[0] == words[1]


def test_readmes_python_runs(monkeypatch):
    (code,) = README_CODE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    monkeypatch.chdir(ROOT)
    # The demo takes half a minute; the tutorial's campaign speaks the same language in seconds.
    code = code.replace("assets/demo", "assets/two_bodies").replace("acc11", "acc5")
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    assert names["result"].verdict.verdict == "explained"
    assert set(re.findall(r"\bmb\.(\w+)", code)) <= set(mbworkbench.__all__)
