"""Pages and tables of ``mbw blind``: sizes with their digits, and what was drawn."""

import json

import pytest

from mbw.blind.page import describe_draws, size_text
from mbw.blind.user_test import title_of


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.99963, "0.99963"),
        (1.0004, "1.00040"),
        (0.928, "0.928"),
        (0.86, "0.86"),
        (1.0, "1"),
        (3.61e9, "3.61e+09"),
        (1.28e-4, "0.000128"),
    ],
)
def test_a_size_near_one_has_the_digits_of_its_difference(value, text):
    assert size_text(value) == text


def test_a_page_says_what_was_drawn(tmp_path):
    choice = {"effects": ["drift"], "places": [], "ratios": [4.0], "parameter": None, "dirt": 5.0}
    request = tmp_path / "asked.json"
    request.write_text(json.dumps({"seed": 7, "choice": choice}))
    sentences = describe_draws(tmp_path)
    assert "The seed is 7. Drawn: drift at drawn places, survival ratios 4." in sentences
    assert "leave 5 % of the motion" in sentences
    choice |= {"places": ["joint:ty"], "ratios": [], "parameter": ["factor", 0.9]}
    request.write_text(json.dumps({"seed": 7, "choice": choice}))
    assert "Drawn: drift at joint:ty, factor = 0.9." in describe_draws(tmp_path)
    request.write_text("[]")
    assert describe_draws(tmp_path) == ""


def test_a_campaign_has_the_title_of_its_folder(tmp_path):
    (tmp_path / "bench").mkdir()
    file = tmp_path / "bench" / "campaign.toml"
    file.touch()
    assert title_of(file) == title_of(file.parent) == "bench"
    assert title_of(tmp_path / "axis.xml") == "axis"
