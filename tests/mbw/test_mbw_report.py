"""``mbw report``: pages of results, and refusals."""

import json

import pytest
from browser import data_of
from campaign_folder import write_folder

from mbw.tune.page import render
from tests.helpers.command import invoke as mbw
from tuning import read_result


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("report")
    campaign = write_folder(place / "campaign")
    assert mbw("tune", campaign, "--out", place / "result", "--quiet").exit_code == 0
    return place / "result"


def test_the_report_is_written_beside_its_result_or_to_the_named_file(folder, tmp_path):
    assert mbw("report", folder).exit_code == 0
    assert (folder / "report.html").is_file()
    assert mbw("report", folder / "tuned.json", "--out", tmp_path / "mine.html").exit_code == 0
    assert (tmp_path / "mine.html").is_file()
    assert mbw("report", folder, "--out", tmp_path / "sub").exit_code == 0
    assert (tmp_path / "sub" / "report.html").is_file()


def test_every_body_direction_and_hit_has_its_overlay(folder):
    data = data_of(render(read_result(folder)))
    assert data["bodies"] == ["base", "head"]
    assert len(data["channels"]) == 2 * 6 * 3
    assert {channel["reference"] for channel in data["channels"]} == {
        "acc3:+tx", "acc3:-ty", "acc3:+tz",
    }  # fmt: skip


def test_the_figures_are_those_of_the_result(folder):
    summary = json.loads((folder / "tuned.json").read_text())
    text = render(read_result(folder))
    data = data_of(text)
    levels = (summary["gap"]["sensors"], summary["gap"]["bodies"])
    bars = {bar["name"]: bar["error"] for bar in data["gap"]}
    assert bars["held out"] == [level["held_out"]["error"] for level in levels]
    assert bars["as drawn"] == [level["as_drawn"]["error"] for level in levels]
    assert f"{100 * levels[0]['tuned']['error']:.3g} %" in text
    for row in summary["parameters"]:
        assert row["name"] in text


def test_names_cannot_break_the_page(folder, tmp_path):
    summary = json.loads((folder / "tuned.json").read_text())
    summary["model"] = "</script><b>&model"
    summary["remaining_gap"][0]["body"] = "</script><script>alert(1)"
    for row in summary["parameters"][::7]:
        row["name"] = "<b>&model" + row["name"]
    summary["inputs"][0]["file"] = "<b>&model"
    (tmp_path / "tuned.json").write_text(json.dumps(summary))
    (tmp_path / "frf.npz").write_bytes((folder / "frf.npz").read_bytes())
    text = render(read_result(tmp_path))
    assert "<b>&model" not in text
    assert "<script>alert" not in text


@pytest.mark.parametrize(
    "fault", ["nothing", "no frf", "other json", "broken npz", "cut npz", "empty npz"]
)
def test_what_is_no_result_is_refused(folder, tmp_path, fault):
    if fault != "nothing":
        (tmp_path / "tuned.json").write_bytes((folder / "tuned.json").read_bytes())
        (tmp_path / "frf.npz").write_bytes((folder / "frf.npz").read_bytes())
    if fault == "no frf":
        (tmp_path / "frf.npz").unlink()
    if fault == "other json":
        (tmp_path / "tuned.json").write_text('{"campaign": 3}')
    if fault == "broken npz":
        (tmp_path / "frf.npz").write_bytes(b"PK no archive")
    if fault == "cut npz":
        (tmp_path / "frf.npz").write_bytes((folder / "frf.npz").read_bytes()[:3000])
    if fault == "empty npz":
        (tmp_path / "frf.npz").write_bytes(b"")
    result = mbw("report", tmp_path)
    assert result.exit_code == 3
    assert len(result.stderr.strip().splitlines()) == 1
    assert "mbw tune" in result.stderr
    if fault == "nothing":
        assert all(verb in result.stderr for verb in ("identify", "diagnose", "match"))
    assert not (tmp_path / "report.html").exists()
