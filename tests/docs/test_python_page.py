"""The reference pages of Python name all that is public."""

import re

import mbworkbench
from tests.docs.pages import DOCS


def names_on(page):
    text = (DOCS / "reference" / page).read_text(encoding="utf-8")
    return re.findall(r"^::: (\S+)$", text, re.MULTILINE)


def test_every_name_of_the_package_is_on_its_page():
    public = {f"mbworkbench.{name}" for name in mbworkbench.__all__ if not name.startswith("_")}
    assert set(names_on("python.md")) == public


def test_interface_for_effects_is_on_its_page():
    assert names_on("effects.md") == [
        "diagnosis.Effect",
        "diagnosis.Hypothesis",
        "diagnosis.Scene",
        "mbmodel.AddedPart",
        "mbmodel.Change",
        "mbmodel.Parameter",
    ]
