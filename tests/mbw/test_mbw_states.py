"""Campaigns with states on the command line: resumption, the plant of the verdict, its page."""

import json

import pytest

from mbw.diagnose import verb
from tests.helpers.changed_chain import write_chain
from tests.helpers.command import invoke as mbw
from tuning.files.plant_folder import VERDICT

STEP = "refits of the most promising hypotheses"


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("states")
    chain = write_chain(folder / "chain", factor=1.003)
    whole = mbw("diagnose", chain, "--out", folder / "whole")
    return chain, folder / "whole", whole


def test_an_interrupted_diagnosis_of_states_ends_with_the_same_bits(
    diagnosed, tmp_path, monkeypatch
):
    chain, whole, _ = diagnosed
    show = verb._show_step

    def interrupt(progress, bar, text):
        if text == STEP:
            raise KeyboardInterrupt
        show(progress, bar, text)

    with monkeypatch.context() as patch:
        patch.setattr(verb, "_show_step", interrupt)
        stopped = mbw("diagnose", chain, "--out", tmp_path / "resumed")
    assert stopped.exit_code == 130
    resumed = mbw("diagnose", chain, "--out", tmp_path / "resumed", "--resume")
    assert resumed.exit_code == 0
    assert "holds no interrupted run" not in resumed.output
    assert (tmp_path / "resumed" / VERDICT).read_bytes() == (whole / VERDICT).read_bytes()


def test_the_plant_after_a_change_has_bands_about_the_changed_spring(diagnosed, tmp_path):
    _, whole, result = diagnosed
    assert result.exit_code == 0
    assert "its tolerance of 2 % is in the intervals" in result.output
    cause = json.loads((whole / VERDICT).read_text())["causes"][0]
    assert cause["effect"] == "stiffness"
    bands = mbw("predict", whole, "--bands", "--out", tmp_path / "predicted")
    assert bands.exit_code == 0, bands.output
    assert "bands: the 95 % interval" in bands.output


def test_the_page_of_a_change_is_written_again(diagnosed, tmp_path):
    _, whole, _ = diagnosed
    assert mbw("report", whole, "--out", tmp_path / "page").exit_code == 0
    page = next((tmp_path / "page").glob("*.html")).read_text(encoding="utf-8")
    assert "another stiffness" in page
