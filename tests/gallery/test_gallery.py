"""The gallery opens from its committed results, and two machines come out the same again."""

import io
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from diagnosis import build_verdict, diagnose
from identification.words import InputError
from mbmodel import load_machine
from mbw.command import app
from mbw.gallery import find_part, resolve_names
from mbw.workbench.opening import open_subject
from tests.bench.gallery import MOST_CORE_S, open_machine
from tests.docs.gallery_page import GALLERY_PAGE, GALLERY_PICTURES, gallery_page
from tests.docs.gallery_pictures import MOST_BYTES
from tests.gallery.__main__ import main
from tests.gallery.machines import GALLERY, RECORD, GalleryMachine, gallery_machines
from tuning import open_session

MACHINES = {machine.name: machine for machine in gallery_machines()}
AGAIN = ("servo-axis", "isolation-table")  # cheap ones
MOST_BYTES_OF_ALL = 10_000_000


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_opens_with_the_verdict_that_is_committed(name):
    machine = MACHINES[name]
    folder = find_part(name, "diagnosed")
    subject = open_subject(folder, None, None)
    assert subject.verdict.diagnosis.verdict == machine.verdict
    assert "diagnosed" in subject.stored
    assert not [remark for remark in subject.remarks if str(folder) in remark]
    # The page begins at the fit: with what the diagnosis found, it is far nearer to the test.
    gap = machine.verdict.gap
    assert (gap.after.excess or gap.retuned.excess) < 0.5 * gap.as_drawn.excess


@pytest.mark.parametrize("name", MACHINES)
def test_results_are_those_of_the_inputs_of_now(name):
    machine = MACHINES[name]
    assert machine.record["inputs"] == machine.hash_inputs(), "make gallery makes it anew"
    assert bool(machine.answer) != machine.is_measured
    load_machine(machine.diagnosed / "augmented.xml")


@pytest.mark.parametrize("name", AGAIN)
def test_a_campaign_drawn_anew_is_diagnosed_as_the_committed_one(name, tmp_path):
    machine = MACHINES[name]
    for file, content in machine.draw().files.items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_bytes(content)
    session, committed = open_session(tmp_path), open_session(machine.campaign).campaign
    for new, old in zip(session.campaign.tests, committed.tests, strict=True):
        limit = 1e-5 * np.abs(old.estimate.frf.values).max()
        np.testing.assert_allclose(new.estimate.frf.values, old.estimate.frf.values, atol=limit)
    verdict = build_verdict(diagnose(session))
    assert verdict.verdict == machine.verdict.verdict
    assert [(row.effect, row.location, row.dof) for row in verdict.causes] == [
        (row.effect, row.location, row.dof) for row in machine.verdict.causes
    ]
    assert verdict.gap.after.excess == pytest.approx(machine.verdict.gap.after.excess, rel=0.01)


def test_the_command_serves_a_machine_in_seconds(tmp_path):
    _, core = open_machine(AGAIN[0], tmp_path)
    assert core < 3 * MOST_CORE_S, "make bench ONLY=gallery measures all of them"


def test_a_diagnosis_opens_on_its_own_band(tmp_path):
    copy = shutil.copytree(GALLERY, tmp_path / "gallery")
    file = copy / MACHINES[AGAIN[0]].diagnosed.name / "diagnosis.json"
    file.write_text(json.dumps(json.loads(file.read_text("utf-8")) | {"band": [40.0, 100.0]}))
    freq_hz = open_subject(file.parent, None, None).freq_hz
    assert (freq_hz[0], freq_hz[-1]) == (40.0, 100.0)


def test_the_list_has_a_sentence_for_each_machine():
    listed = CliRunner().invoke(app, ["open", "gallery:"])
    assert listed.exit_code == 0
    lines = listed.stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(MACHINES)
    assert all(
        machine.row["is"] in line for machine, line in zip(MACHINES.values(), lines, strict=True)
    )
    assert CliRunner().invoke(app, ["open", "gallery:list"]).stdout == listed.stdout


def test_an_unknown_machine_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="did you mean gallery:gantry"):
        resolve_names([Path("gallery:gantri")], "campaign")


def test_other_values_stay_as_they_are(tmp_path):
    values = [tmp_path, "gantry", 3, None, [tmp_path, 2.0]]
    assert resolve_names(values, "campaign") == (values, {})


def test_a_verb_takes_a_machine_by_name_and_writes_into_the_current_folder(tmp_path, monkeypatch):
    before = sorted(GALLERY.rglob("*"))
    monkeypatch.chdir(tmp_path)
    words = {
        "tune": "gallery:servo-axis --no-pictures",
        "predict": "gallery:tower --no-pictures",
        "blind": "gallery:servo-axis --smallest --effect mass_error --place body:slide",
        "report": "gallery:tower",
    }
    for verb, options in words.items():
        done = CliRunner().invoke(app, [verb, *options.split(), "--quiet"])
        assert done.exit_code in (0, 4), done.output
    assert {path.name for path in tmp_path.iterdir()} == {
        "servo-axis-tuned",
        "servo-axis-smallest",
        "tower-diagnosed",
    }
    assert sorted(GALLERY.rglob("*")) == before
    tuned = open_subject(tmp_path / "servo-axis-tuned", None, None)
    assert tuned.source == MACHINES["servo-axis"].campaign / "campaign.toml"
    refused = CliRunner().invoke(app, ["diagnose", "gallery:servo"])
    assert refused.exit_code == 3
    assert "did you mean gallery:servo-axis?" in refused.stderr
    picture = ["view", "gallery:servo-axis", "--out", "axis.png"]
    assert CliRunner().invoke(app, picture).exit_code == 0
    assert (tmp_path / "axis.png").is_file()


def test_what_exists_is_not_made_again(capsys, monkeypatch):
    monkeypatch.setattr(GalleryMachine, "run", lambda self: pytest.fail(self.name))
    assert main([]) == 0
    assert capsys.readouterr().out.count("(kept)") == len(MACHINES)


@pytest.mark.parametrize("name", MACHINES)
def test_a_picture_moves_and_is_small(name):
    content = (GALLERY_PICTURES / f"{name}.webp").read_bytes()
    assert len(content) <= MOST_BYTES
    with Image.open(io.BytesIO(content)) as picture:
        assert picture.n_frames > 5


def test_the_page_follows_from_the_results():
    written = GALLERY_PAGE.read_text(encoding="utf-8")
    assert written == gallery_page(), "python -m tests.docs makes it anew"


def test_the_assets_stay_small():
    files = [path for path in GALLERY.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= MOST_BYTES_OF_ALL
    assert sum(path.name == RECORD for path in files) == len(MACHINES)
