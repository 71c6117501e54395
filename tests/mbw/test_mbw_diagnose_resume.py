"""Resumption of an interrupted diagnosis, with a verdict equal to the last bit."""

import json

import pytest
from typer.testing import CliRunner

from diagnosis.refits import refitting
from mbw.command import app
from mbw.diagnose import verb
from mbw.results.diagnosed_files import CHECKPOINT, EVIDENCE
from tests.helpers.drawn import drawn
from tuning.files.plant_folder import VERDICT

STEP = "refits of the most promising hypotheses"  # the null model is finished then


def mbw(*arguments):
    return CliRunner().invoke(app, ["diagnose", *map(str, arguments)])


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("interrupted")
    drawn(folder, 72_013, "gyroscopic", ratio=6.0, lines=81)
    return folder / "campaign"


@pytest.fixture
def count_refits(monkeypatch):
    """Return a list that grows by one with each refit that is made."""
    made, refit = [], refitting._refit

    def counted(*arguments):
        made.append(1)
        return refit(*arguments)

    monkeypatch.setattr(refitting, "_refit", counted)
    return made


def interrupt_at(monkeypatch, step):
    """Raise KeyboardInterrupt where a step of the diagnosis begins."""
    show = verb._show_step

    def shown(progress, bar, text):
        if text == step:
            raise KeyboardInterrupt
        show(progress, bar, text)

    monkeypatch.setattr(verb, "_show_step", shown)


def test_an_interrupted_diagnosis_that_is_resumed_ends_with_the_same_bits(
    campaign, tmp_path, monkeypatch, count_refits
):
    assert mbw(campaign, "--out", tmp_path / "whole").exit_code == 0
    total = len(count_refits)
    with monkeypatch.context() as patch:
        interrupt_at(patch, STEP)
        outcome = mbw(campaign, "--out", tmp_path / "out")
    finished = len(json.loads((tmp_path / "out" / CHECKPOINT).read_text())["steps"])
    assert outcome.exit_code == 130
    assert f"continue with --resume: finished steps are kept ({finished})" in outcome.stderr
    count_refits.clear()
    assert mbw(campaign, "--out", tmp_path / "out", "--resume").exit_code == 0
    assert 0 < finished < total
    assert len(count_refits) == total - (finished - 1)  # the null model is a step, and no refit
    for name in (VERDICT, EVIDENCE):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert not (tmp_path / "out" / CHECKPOINT).exists()


def test_refits_of_another_campaign_are_refused_by_name(campaign, tmp_path):
    (tmp_path / CHECKPOINT).write_text(json.dumps({"fingerprint": "another", "steps": {}}))
    outcome = mbw(campaign, "--out", tmp_path, "--resume")
    assert outcome.exit_code == 3
    assert "belongs to other inputs or options" in " ".join(outcome.stderr.split())


def test_resuming_without_an_interrupted_run_is_told(campaign, tmp_path, monkeypatch):
    interrupt_at(monkeypatch, "hits and sensors compared with each other")
    outcome = mbw(campaign, "--out", tmp_path / "new", "--resume")
    assert outcome.exit_code == 130
    assert "holds no interrupted run to resume" in " ".join(outcome.stderr.split())
