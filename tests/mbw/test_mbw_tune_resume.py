"""Resumption of a killed tuning, with a result equal to the last bit."""

import json

import pytest
from typer.testing import CliRunner

from mbw.command import app
from tests.helpers.killed import campaign_in, killed_and_resumed, whole
from tuning import CHECKPOINT_FILE


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return campaign_in(tmp_path_factory.mktemp("killed"), 65_001)


@pytest.fixture(scope="module")
def undisturbed(campaign, tmp_path_factory):
    return whole(campaign, tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("steps", [1, 6])
def test_a_killed_run_that_is_resumed_ends_with_the_same_bits(
    campaign, undisturbed, tmp_path, steps
):
    bits, _ = undisturbed
    found = killed_and_resumed(campaign, tmp_path, steps=steps)
    assert found.killed
    assert found.steps >= steps
    assert found.bits == bits
    assert not (tmp_path / CHECKPOINT_FILE).exists()


def kept_from(other, tmp_path):
    """A checkpoint whose fingerprint is another's."""
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / CHECKPOINT_FILE).write_text(json.dumps({"fingerprint": other, "steps": {}}))


def test_steps_of_other_inputs_are_refused_by_name(campaign, tmp_path):
    kept_from("another", tmp_path)
    run = CliRunner().invoke(app, ["tune", str(campaign), "--out", str(tmp_path), "--resume"])
    assert run.exit_code == 3
    assert "belongs to other inputs or options" in " ".join(run.stderr.split())


def test_a_broken_checkpoint_is_refused_by_name(campaign, tmp_path):
    (tmp_path / CHECKPOINT_FILE).write_text('{"fingerprint": ')
    run = CliRunner().invoke(app, ["tune", str(campaign), "--out", str(tmp_path), "--resume"])
    assert run.exit_code == 3
    assert "start again without --resume" in " ".join(run.stderr.split())


def test_resuming_without_an_interrupted_run_is_told(campaign, tmp_path):
    nowhere = ["--from-modes", str(tmp_path / "nowhere")]  # ends the run before the fit
    run = CliRunner().invoke(
        app, ["tune", str(campaign), "--out", str(tmp_path / "new"), "--resume", *nowhere]
    )
    assert run.exit_code == 3
    assert "holds no interrupted run to resume" in " ".join(run.stderr.split())
