"""Output folders: named after campaign or model, never another's, checked first, locked."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from campaign_folder import write_folder
from small_machine import MJCF

from identification.words import InputError
from mbw.messages import SCREEN
from mbw.output_folder import RECORD, OutputRequest, default_folder, open_output_folder
from mbw.predict import verb as predict_verb
from tests.helpers.command import invoke as run

ROOT = Path(__file__).resolve().parents[2]
HOLD = """
import sys, time
from pathlib import Path
from mbw.output_folder import OutputRequest, open_output_folder
with open_output_folder(OutputRequest("tune", Path(sys.argv[1]), Path(sys.argv[2]), ())) as output:
    (output.path / "held").touch()
    time.sleep(60)
"""


@pytest.fixture
def models(tmp_path):
    """Two models of one name in two folders."""
    paths = [tmp_path / place / "machine.xml" for place in ("first", "second")]
    for path in paths:
        path.parent.mkdir()
        path.write_text(MJCF, encoding="utf-8")
    return paths


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("output") / "test1")


def test_results_go_beside_the_campaign_or_model_and_bear_its_name(
    models, campaign, tmp_path, monkeypatch
):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    for model in models:
        assert run("predict", model, "-q").exit_code == 0
        assert (model.parent / "machine-predicted" / "predict.html").is_file()
    assert run("identify", campaign, "--no-pictures", "-q").exit_code == 0
    assert (campaign.parent / "test1-modes" / "modes.json").is_file()
    assert not list(elsewhere.iterdir())
    monkeypatch.chdir(campaign)
    assert run("identify", ".", "--no-pictures", "-q").exit_code == 0
    assert default_folder(Path("campaign.toml"), "modes") == campaign.parent / "test1-modes"


def test_where_nothing_can_be_written_beside_the_current_folder_serves_and_is_named(
    models, tmp_path, monkeypatch, capsys
):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(SCREEN, "quiet", False)
    models[0].parent.chmod(0o555)  # the superuser could write, and does not either
    assert default_folder(models[0], "predicted") == Path("machine-predicted")
    words = " ".join(capsys.readouterr().err.split())
    assert f"cannot be written: the results go to {here / 'machine-predicted'}" in words


def test_another_models_result_is_replaced_with_overwrite_only(models, tmp_path):
    first, second = models
    out = tmp_path / "out"
    assert run("predict", first, "--out", out).exit_code == 0
    page = (out / "predict.html").read_bytes()
    refused = run("predict", second, "--out", out)
    assert refused.exit_code == 3
    assert str(first) in refused.stderr
    assert "--overwrite" in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert (out / "predict.html").read_bytes() == page
    assert run("predict", first, "--out", out).exit_code == 0, "its own result"
    assert run("predict", second, "--out", out, "--overwrite").exit_code == 0
    assert run("predict", first, "--out", out).exit_code == 3, "now the second one's"


def test_a_file_of_that_name_that_nobody_recorded_is_not_replaced(models, tmp_path):
    (tmp_path / "predict.html").write_text("my notes")
    refused = run("predict", models[0], "--out", tmp_path)
    assert refused.exit_code == 3
    assert "--overwrite" in refused.stderr
    assert (tmp_path / "predict.html").read_text() == "my notes"
    (tmp_path / RECORD).write_text('{"predict.html": 3}')
    assert run("predict", models[0], "--out", tmp_path).exit_code == 3
    assert run("predict", models[0], "--out", tmp_path, "--overwrite").exit_code == 0


def test_the_default_folder_is_the_models_own_even_without_a_record(models):
    folder = models[0].parent / "machine-predicted"
    folder.mkdir()
    (folder / "predict.html").write_text("of an earlier version")
    assert run("predict", models[0]).exit_code == 0
    assert "earlier" not in (folder / "predict.html").read_text()


def test_a_campaign_and_its_result_can_move_together(models, tmp_path):
    assert run("predict", models[0]).exit_code == 0
    moved = tmp_path / "moved"
    shutil.move(models[0].parent, moved)
    assert run("predict", moved / "machine.xml").exit_code == 0


def test_no_file_of_an_earlier_result_stays_beside_a_newer_one(campaign, tmp_path):
    out = tmp_path / "out"
    assert run("identify", campaign, "--out", out, "--full", "-q").exit_code == 0
    assert {"identify.html", "full_matrix.npz"} <= {path.name for path in out.iterdir()}
    (out / "notes.txt").write_text("mine")
    again = ("identify", campaign, "--out", out, "--band", 20, 110, "--no-pictures", "-q")
    assert run(*again).exit_code == 0
    names = {path.name for path in out.iterdir()}
    assert not {"identify.html", "full_matrix.npz"} & names
    assert "notes.txt" in names


def test_an_unusable_folder_is_refused_before_the_work(models, tmp_path, monkeypatch):
    def never(*_, **__):
        raise AssertionError("the work was begun")

    monkeypatch.setattr(predict_verb, "predict_outcome", never)
    (tmp_path / "out" / "predict.html").mkdir(parents=True)
    refused = run("predict", models[0], "--out", tmp_path / "out")
    assert refused.exit_code == 3
    assert "is a folder" in refused.stderr
    (tmp_path / "file").touch()
    refused = run("predict", models[0], "--out", tmp_path / "file" / "out")
    assert refused.exit_code == 3
    assert "cannot be created" in refused.stderr


def test_two_runs_into_one_folder_are_refused_and_a_killed_one_holds_nothing(models, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-c", HOLD, str(models[0]), str(out)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment) as process:
        for _ in range(300):
            if (out / "held").exists() or process.poll() is not None:
                break
            time.sleep(0.1)
        refused = run("predict", models[0], "--out", out)
        assert refused.exit_code == 3
        assert "another run" in refused.stderr
        process.send_signal(signal.SIGKILL)
    assert run("predict", models[0], "--out", out).exit_code == 0


def test_a_run_that_fails_leaves_no_empty_folder(tmp_path):
    request = OutputRequest("tune", tmp_path / "campaign.toml", tmp_path / "a" / "b", ("x.json",))
    with pytest.raises(InputError), open_output_folder(request):
        raise InputError("no")
    assert not (tmp_path / "a").exists()
    with open_output_folder(request) as output, output.write() as place:
        (place / "x.json").touch()
    rows = json.loads((tmp_path / "a" / "b" / RECORD).read_text())
    assert rows == {"x.json": {"verb": "tune", "source": "../../campaign.toml"}}


def test_a_page_beside_its_result_is_renewed_and_another_page_is_not(models, tmp_path):
    out = tmp_path / "out"
    assert run("predict", models[0], "--out", out, "-q").exit_code == 0
    assert run("report", out, "-q").exit_code == 0
    (out / RECORD).unlink()
    assert run("report", out, "-q").exit_code == 0
    (tmp_path / "mine.html").write_text("notes")
    refused = run("report", out, "--out", tmp_path / "mine.html")
    assert refused.exit_code == 3
    assert "--overwrite" in refused.stderr
