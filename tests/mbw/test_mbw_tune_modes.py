"""``mbw tune`` from modes: options, pairs in tuned.json and in the report, refusals."""

import json
import shutil

import pytest
from campaign_folder import write_folder

from mbw.tune.page import render
from tests.helpers.command import invoke as mbw
from tuning import read_result


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("small") / "campaign")


@pytest.fixture(scope="module")
def identified(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("modes") / "result"
    assert mbw("identify", folder, "--out", out, "--no-pictures", "--quiet").exit_code == 0
    return out


def tuned(folder, tmp_path, *arguments):
    result = mbw("tune", folder, "--out", tmp_path / "out", *arguments)
    assert result.exit_code == 0, result.stderr
    return json.loads((tmp_path / "out" / "tuned.json").read_text()), result


def test_modes_and_then_frfs_reach_the_noise_and_say_the_pairs(folder, tmp_path):
    summary, result = tuned(folder, tmp_path, "--residual", "modal,log")
    assert summary["residuals"] == ["modal", "log"]
    gap = summary["gap"]["sensors"]
    assert 0.8 < gap["tuned"]["excess"] < 1.3
    assert gap["held_out"] is not None
    assert "5 of 5 measured modes" in result.stderr
    assert len(summary["pairs"]) == 5
    assert summary["unpaired_modes"] == []
    for number, row in enumerate(summary["pairs"], start=1):
        near, drawn = row["tuned"], row["as_drawn"]
        assert near["mode"] == number
        assert near["mac"] > 0.99
        assert abs(near["frequency_error"]) < 1e-3 < abs(drawn["frequency_error"])
        assert near["frequency"] == pytest.approx(
            row["frequency"] * (1 + near["frequency_error"]), rel=1e-12
        )
        assert summary["modes"]["tuned"][number - 1]["frequency"] == near["frequency"]


def test_modes_alone_come_near_the_frfs_and_hold_no_lines_out(folder, tmp_path):
    summary, result = tuned(folder, tmp_path, "--residual", "modal", "--starts", 2)
    assert summary["residuals"] == ["modal"]
    assert summary["gap"]["sensors"]["held_out"] is None
    assert summary["gap"]["sensors"]["tuned"]["error"] < 0.02
    assert "no line is held out" in result.stderr
    assert "too narrow" not in result.stderr
    assert "2 of 2 starts" in result.stderr


@pytest.mark.parametrize("name", ["", "modes.json"])
def test_identified_modes_are_taken_from_their_folder(folder, identified, tmp_path, name):
    summary, _ = tuned(
        folder, tmp_path, "--residual", "modal", "--from-modes", identified / name, "-q"
    )
    known = json.loads((identified / "modes.json").read_text())["modes"]
    assert [row["frequency"] for row in summary["pairs"]] == pytest.approx(
        [row["frequency"] for row in known], rel=1e-12
    )


def test_frfs_are_the_default_and_modes_beside_them_only_reported(folder, identified, tmp_path):
    plain, _ = tuned(folder, tmp_path, "-q")
    assert (plain["residuals"], plain["pairs"]) == (["log"], [])
    beside, _ = tuned(folder, tmp_path, "-q", "--from-modes", identified)
    assert beside["fit"] == plain["fit"]
    assert len(beside["pairs"]) == 5


def test_only_modes_of_the_band_count(folder, identified, tmp_path):
    arguments = ("--residual", "modal", "--from-modes", identified, "--band", 60, 110, "-q")
    summary, _ = tuned(folder, tmp_path, *arguments)
    assert len(summary["pairs"]) == 3
    assert all(60 <= row["frequency"] <= 110 for row in summary["pairs"])


def test_the_report_has_a_table_of_the_pairs(folder, identified, tmp_path):
    tuned(folder, tmp_path, "--residual", "modal", "--from-modes", identified, "-q")
    result = read_result(tmp_path / "out")
    text = render(result)
    section = text[text.index("Measured and modelled modes") : text.index("<h2>Tests")]
    assert section.count("<tr>") == 1 + 5
    for row in result.summary.pairs:
        assert f"<td>{row.frequency:.2f}</td>" in section
    assert "Fitted: modes." in section
    lost = [row.model_copy(update={"tuned": None}) for row in result.summary.pairs]
    summary = result.summary.model_copy(update={"pairs": lost})
    text = render(type(result)(summary, result.freq_hz, result.levels))
    assert text.count("<td>none</td>") == 5
    assert "Measured modes without a mode of the model: " in text


def test_a_result_without_pairs_has_no_table_and_is_still_read(folder, tmp_path):
    tuned(folder, tmp_path, "-q")
    path = tmp_path / "out" / "tuned.json"
    summary = json.loads(path.read_text())
    for name in ("residuals", "pairs", "unpaired_modes"):  # as an earlier version wrote it
        del summary[name]
    path.write_text(json.dumps(summary))
    result = read_result(tmp_path / "out")
    assert result.summary.residuals == ["log"]
    assert "Measured modes and the model" not in render(result)


@pytest.mark.parametrize("residual", ["shape", "log,modal", ""])
def test_an_unknown_residual_is_refused_in_one_sentence(folder, tmp_path, residual):
    result = mbw("tune", folder, "--out", tmp_path / "out", "--residual", residual)
    assert result.exit_code == 2
    assert "modal,log" in result.stderr
    assert not (tmp_path / "out").exists()


def test_modes_that_are_none_or_of_another_machine_are_refused(folder, identified, tmp_path):
    arguments = ("tune", folder, "--residual", "modal", "--out", tmp_path / "out", "--from-modes")
    result = mbw(*arguments, tmp_path)
    assert result.exit_code == 3
    assert "mbw identify" in result.stderr
    other = tmp_path / "other"
    shutil.copytree(identified, other)
    text = (other / "modes.json").read_text()
    (other / "modes.json").write_text(text.replace("acc6", "acc66"))
    result = mbw(*arguments, other)
    assert result.exit_code == 3
    assert "acc66" in result.stderr
    assert len(result.stderr.strip().splitlines()) <= 2


def test_a_band_without_modes_is_refused(folder, identified, tmp_path):
    result = mbw(
        "tune", folder, "--out", tmp_path / "out", "--residual", "modal",
        "--from-modes", identified, "--band", 52, 66,
    )  # fmt: skip
    assert result.exit_code == 2
    assert "no mode" in result.stderr
