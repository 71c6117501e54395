"""``mbw tune`` in-process: results, messages, exit codes, and nothing half-written."""

import hashlib
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import scipy.io
from campaign_folder import write_folder

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from mbw.tune import verb
from tests.helpers.command import invoke as mbw
from tuning import FitProgress, read_result
from tuning.fitting import machine_fit


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("small") / "campaign")


@pytest.fixture(scope="session")
def tuned(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("tuned") / "result"
    result = mbw("tune", folder, "--out", out, "--json", "-", "--starts", 2)
    assert result.exit_code == 0, result.stderr
    return out, result


@pytest.fixture
def spoil(folder, tmp_path):
    """A copy of the campaign in which one text of one file is replaced."""

    def copy(file, pattern, replacement):
        target = tmp_path / "campaign"
        shutil.copytree(folder, target)
        path = target / file
        text = path.read_text(encoding="utf-8")
        changed = re.sub(pattern, replacement, text, count=1)
        assert changed != text
        path.write_text(changed, encoding="utf-8")
        return target

    return copy


def test_data_go_to_stdout_and_messages_to_stderr(tuned):
    _, result = tuned
    summary = json.loads(result.stdout)
    assert summary["fit"]["converged"] is True
    assert "tuned: error" in result.stderr
    assert "2 of 2 starts" in result.stderr


def test_the_json_says_the_gap_at_sensors_and_bodies(tuned):
    _, result = tuned
    for level in ("sensors", "bodies"):
        gap = json.loads(result.stdout)["gap"][level]
        assert gap["as_drawn"]["error"] > 5 * gap["tuned"]["error"]
        assert gap["held_out"]["error"] >= 0.9 * gap["tuned"]["error"]
        assert gap["tuned"]["error"] == pytest.approx(gap["noise"], rel=0.3)
        assert 0.8 < gap["tuned"]["excess"] < 1.3


def test_the_tuned_mjcf_answers_as_the_reported_tuning(folder, tmp_path):
    # A site of its own for the hammer, and no gains: else no MJCF could hold all that was tuned.
    campaign, out = tmp_path / "campaign", tmp_path / "result"
    shutil.copytree(folder, campaign)
    model, settings = campaign / "model.xml", campaign / "campaign.toml"
    site = '<site name="acc3" pos="0.1 0.15 0.75"/>'
    assert site in model.read_text()
    model.write_text(model.read_text().replace(site, site + site.replace("acc3", "hit3")))
    fixed = '\n[tuning]\nfix = ["*.gain_*", "*.cross_*", "*.delay_*", "hammer(*"]\n'
    settings.write_text(settings.read_text() + fixed)
    result = mbw("tune", campaign, "--out", out, "--json", "-")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary["not_held_by_mjcf"] == []
    kinds = {row["location"].split(":")[0] for row in summary["parameters"]}
    assert kinds == {"joint", "body", "sensor"}
    written = as_drawn(load_machine(out / "tuned.xml"))
    stated = {row["name"]: row["tuned"] for row in summary["parameters"]}
    theta = np.array([stated[parameter.name] for parameter in written.parameters])
    assert written.drawn == pytest.approx(theta, rel=1e-14)
    read = read_result(out)
    level = read.levels["sensors"]
    first = [k for k, test in enumerate(level.tests) if test == level.tests[0]]
    outputs = tuple(Dof.parse(level.outputs[k]) for k in first)
    question = FrfRequest(read.freq_hz, outputs, (Dof("hit3", "+tx"),))
    values = Evaluator(written, question).at(written.drawn).values[:, :, 0]
    # Stored in single precision.
    scale = np.abs(values).max(axis=0)
    assert np.abs(level.tuned[:, first] - values).max() < 1e-6 * scale.max()


def test_what_varies_and_what_the_mjcf_lacks_is_said_in_few_words(tuned):
    out, result = tuned
    assert "12 parameters, 130 tolerances" in result.stderr
    (line,) = [text for text in result.stderr.splitlines() if "MJCF does not hold" in text]
    assert (
        "gains of 6 sensors, delays of 6 sensors, gain of 1 force channel, "
        "delay of 1 force channel, place and direction of 3 hits (" in line
    )
    assert re.search(r"\(without them the FRFs change by [\d.]+ %; tuned.json lists", line)
    assert line.endswith("tuned.json lists them).")
    names = json.loads((out / "tuned.json").read_text())["not_held_by_mjcf"]
    assert len([name for name in names if ".gain_" in name]) == 3 * 6


def test_tune_leads_to_the_diagnosis_and_judges_no_further(folder, tuned):
    _, result = tuned
    fit = json.loads(result.stdout)["fit"]
    assert fit["trusted"] == (not fit["doubts"])
    assert ("Doubts:" in result.stderr) == bool(fit["doubts"])
    assert result.stderr.count(f"mbw diagnose {folder}") == 1
    assert "trusted" not in result.stderr
    assert "lacks some" not in result.stderr


def test_the_inputs_are_named_with_their_hashes(folder, tuned):
    _, result = tuned
    inputs = {row["file"]: row["sha256"] for row in json.loads(result.stdout)["inputs"]}
    assert set(inputs) == {"campaign.toml", "impact.mat", "model.xml"}
    for file, digest in inputs.items():
        assert hashlib.sha256((folder / file).read_bytes()).hexdigest() == digest


def test_the_folder_holds_four_files_with_their_record_and_no_traces(tuned):
    out, _ = tuned
    names = [".mbw.json", "frf.npz", "posterior.npz", "report.html", "tuned.json", "tuned.xml"]
    assert sorted(path.name for path in out.iterdir()) == names
    assert "pictures in file://" in tuned[1].stderr


def test_without_pictures_no_page_is_written_and_an_old_one_goes(tuned, folder):
    out, _ = tuned
    assert mbw("tune", folder, "--out", out, "--no-pictures", "-q").exit_code == 0
    assert not (out / "report.html").exists()
    assert mbw("tune", folder, "--out", out, "-q").exit_code == 0
    assert (out / "report.html").is_file()


def test_an_interrupt_writes_the_best_so_far_and_exits_130(folder, tmp_path, monkeypatch):
    whole = machine_fit.fit

    def interrupted(*args, report=None, **kwargs):
        def tell(step: FitProgress):
            report(step)
            if step.stage == 1:
                raise KeyboardInterrupt

        return whole(*args, report=tell, **kwargs)

    monkeypatch.setattr(machine_fit, "fit", interrupted)
    result = mbw("tune", folder, "--out", tmp_path / "out")
    assert result.exit_code == 130
    assert "best parameters" in result.stderr
    summary = json.loads((tmp_path / "out" / "tuned.json").read_text())
    assert summary["fit"]["outcome"] == "interrupted"
    assert summary["interrupted"] is True
    assert summary["gap"]["sensors"]["held_out"] is None
    gap = summary["gap"]["sensors"]
    assert gap["tuned"]["error"] < gap["as_drawn"]["error"]
    assert "it was interrupted" in summary["fit"]["doubts"]
    assert all(row["low"] is None for row in summary["parameters"])
    assert mbw("report", tmp_path / "out").exit_code == 0


def test_a_search_that_does_not_converge_exits_4_with_its_result(folder, tmp_path, monkeypatch):
    whole = machine_fit.fit

    def tired(*args, **kwargs):
        return replace(whole(*args, **kwargs), outcome="out of evaluations", advice="allow more")

    monkeypatch.setattr(machine_fit, "fit", tired)
    result = mbw("tune", folder, "--out", tmp_path / "out", "--quiet")
    assert result.exit_code == 4
    assert "allow more" in result.stderr
    assert (tmp_path / "out" / "tuned.json").exists()


def test_quiet_says_nothing_but_errors(folder, tmp_path):
    result = mbw("tune", folder, "--out", tmp_path / "out", "--quiet")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_a_band_narrows_the_lines(folder, tmp_path):
    result = mbw("tune", folder, "--out", tmp_path / "o", "--band", 20, 100, "--json", "-", "-q")
    summary = json.loads(result.stdout)
    assert summary["band"][0] >= 20
    assert summary["band"][1] <= 100


SPOILED = [
    # file, what is replaced, by what, words that the message must have
    ("campaign.toml", 'model = "model.xml"', 'model = "none.xml"', ["none.xml", "does not exist"]),
    ("campaign.toml", "impact.mat", "gone.mat", ["gone.mat", "does not exist"]),
    ("campaign.toml", "averages = 10", "averges = 10", ["campaign.toml", "averges"]),
    ("campaign.toml", "averages = 10", "averages = = 10", ["campaign.toml", "line 5"]),
    ("campaign.toml", "averages = 10", "averages = 0", ["campaign.toml", "averages"]),
    ("campaign.toml", "1..6, xyz", "1..7, xyz", ["impact.mat", "21 channels"]),
    ("campaign.toml", "1..6, xyz", "1..5 7, xyz", ["impact.mat", "node 7", "acc7"]),
    ("model.xml", 'stiffness="3e7"', 'stiffness="-3e7"', ["model.xml", "base_tx", "0 or more"]),
    ("model.xml", 'damping="700"', 'damping="-700"', ["model.xml", "head_tx"]),
    ("model.xml", 'stiffness="3e7"', 'stiffness="nan"', ["model.xml", "base_tx"]),
    ("model.xml", '<inertial pos="0 0.03.*?/>', "", ["model.xml", "head", "mass"]),
    ("model.xml", 'name="acc4"', 'name="acc03"', ["model.xml", "acc3", "node 3"]),
    ("model.xml", "</worldbody>", "</worldbody", ["model.xml", "line"]),
    (
        "model.xml",
        '<site name="acc3"',
        '<geom type="sphere" size="0.9" mass="0"/><geom type="sphere" size="0.9" mass="0"/>'
        '<site name="acc3"',
        ["model.xml", "contact", "contype"],
    ),
]


@pytest.mark.parametrize(("file", "pattern", "replacement", "words"), SPOILED)
def test_bad_input_exits_3_with_one_sentence_and_writes_nothing(
    spoil, tmp_path, file, pattern, replacement, words
):
    campaign = spoil(file, pattern, replacement)
    if "contact" in words:  # the base needs something to touch
        model = campaign / "model.xml"
        model.write_text(
            model.read_text()
            .replace(
                '<site name="acc1"',
                '<geom type="box" size="1 1 .2" pos="0 0 -.3" mass="0"/><site name="acc1"',
            )
            .replace('<body name="base">', '<geom type="plane" size="2 2 1"/><body name="base">')
        )
    out = tmp_path / "out"
    result = mbw("tune", campaign, "--out", out)
    assert result.exit_code == 3, result.stderr
    assert result.stdout == ""
    last = result.stderr.strip().splitlines()
    assert len(last) == 1
    for word in words:
        assert word in last[0]
    assert not out.exists()
    assert "Traceback" not in result.stderr


def test_nan_in_the_data_is_named(folder, tmp_path):
    target = tmp_path / "campaign"
    shutil.copytree(folder, target)
    content = scipy.io.loadmat(target / "impact.mat")
    content["FRFs"][4, 1, 7] = np.nan
    scipy.io.savemat(
        target / "impact.mat", {k: v for k, v in content.items() if not k.startswith("__")}
    )
    result = mbw("tune", target, "--out", tmp_path / "out")
    assert result.exit_code == 3
    for word in ("impact.mat", "NaN", "2:+ty", "3:-ty"):
        assert word in result.stderr
    assert not (tmp_path / "out").exists()


def test_an_empty_band_exits_3(folder, tmp_path):
    result = mbw("tune", folder, "--out", tmp_path / "out", "--band", 300, 400)
    assert result.exit_code == 3
    assert "300" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [("tune",), ("nonsense",), ("tune", "x", "--starts", "0")])
def test_a_wrong_call_exits_2(arguments):
    assert mbw(*arguments).exit_code == 2


def _no_work(*args, **kwargs):
    raise AssertionError("the work was begun")


def test_results_that_cannot_be_written_are_refused_before_the_work(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(verb, "tune", _no_work)
    blocked = tmp_path / "file"
    blocked.write_text("x")
    taken = tmp_path / "taken"
    (taken / "tuned.json").mkdir(parents=True)
    for arguments, words in (
        (("--out", blocked / "out"), "cannot be created"),
        (("--out", taken), "is a folder"),
        (("--out", tmp_path / "o", "--json", tmp_path / "nowhere" / "x.json"), "cannot be written"),
    ):
        result = mbw("tune", folder, *arguments)
        assert result.exit_code == 3, result.stderr
        assert words in result.stderr


@pytest.mark.parametrize(("low", "high"), [(50, 50), (50, 55), (50, 75)])
def test_a_narrow_band_is_tuned_but_claims_no_held_out_lines(folder, tmp_path, low, high):
    out = tmp_path / "out"
    result = mbw("tune", folder, "--out", out, "--band", low - 1, high + 1)
    assert result.exit_code in (0, 4), result.stderr
    summary = json.loads((out / "tuned.json").read_text())
    narrow = summary["lines"] <= 8
    assert (summary["gap"]["sensors"]["held_out"] is None) == narrow
    assert ("too narrow" in result.stderr) == narrow


def test_a_noise_that_is_estimated_from_differences_is_reported_so(spoil, tmp_path):
    campaign = spoil("campaign.toml", "averages = 10\n", "")
    result = mbw("tune", campaign, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert "third differences" in result.stderr
    summary = json.loads((tmp_path / "out" / "tuned.json").read_text())
    assert {test["variance_from"] for test in summary["tests"]} == {"differences"}


def test_one_file_in_two_tests_is_refused(folder, tmp_path):
    target = tmp_path / "campaign"
    shutil.copytree(folder, target)
    text = (target / "campaign.toml").read_text()
    (target / "campaign.toml").write_text(text + text[text.index("[[test]]") :])
    result = mbw("tune", target, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "two [[test]] blocks" in result.stderr


def test_a_model_with_nothing_to_tune_is_refused(tmp_path):
    target = tmp_path / "campaign"
    write_folder(target)
    model = target / "model.xml"
    model.write_text(re.sub(r'\s(stiffness|damping)="[^"]*"', "", model.read_text()))
    result = mbw("tune", target, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "to tune" in result.stderr


def test_an_internal_error_exits_1_and_shows_a_traceback_only_with_debug(folder, monkeypatch):
    def broken(*args, **kwargs):
        raise ZeroDivisionError("a fault of ours")

    monkeypatch.setattr(verb, "open_session", broken)
    result = mbw("tune", folder)
    assert result.exit_code == 1
    assert "internal error" in result.stderr
    assert "Traceback" not in result.stderr
    loud = mbw("--debug", "tune", folder)
    assert isinstance(loud.exception, ZeroDivisionError)
