"""Tests with a known mass or a stage elsewhere: tuned together, diagnosed, identified apart.

The data come from matrices written by hand.
"""

import json

import numpy as np
import pytest
from encoder_campaign import axis_frfs, write_encoder_campaign, write_loaded_axis
from typer.testing import CliRunner

import mbworkbench as mb
from identification.words import InputError
from mbw.command import app
from tuning import open_session
from tuning import tune as tune_campaign
from tuning.files.input_files import input_rows
from tuning.misfit.batch import predict

RUNNER = CliRunner()
ADDED = 6.0  # kg, at the carriage's centre
LOADED, POSE = 'model = "loaded.xml"', "pose = { carriage_tx = 0.12 }"
SCALES = {"carriage_tx": 1.2, "frame_tx": 0.85, "frame_ry": 1.15}
WIDE = "[tolerance]\nmass = 0.1\ninertia = 0.1\nhammer_gain = 0.06\n"


def write_case(folder, further, **case):
    folder.mkdir(parents=True, exist_ok=True)
    write_loaded_axis(folder / "loaded.xml", ADDED)
    write_encoder_campaign(folder, further=further, **case)
    return folder


def fitted(folder, **options):
    session = open_session(folder, (10.0, 160.0))
    tuned = tune_campaign(session, **options)
    names = [parameter.name for parameter in session.model.parameters]
    return tuned, dict(zip(names, tuned.model_fit.theta, strict=True))


@pytest.mark.parametrize(
    ("line", "state"), [(LOADED, {"added_mass": ADDED}), (POSE, {"shift": 0.12})]
)
def test_each_test_is_predicted_by_its_own_machine(tmp_path, line, state):
    write_case(tmp_path, {line: state}, lines=30)
    session = open_session(tmp_path, (10.0, 160.0))
    freq = session.campaign.freq_hz
    answers = predict(session.model, session.model.drawn, session.campaign)
    whole = {"": axis_frfs(freq, {}), "own": axis_frfs(freq, {}, **state)}
    assert len(answers) == 6
    for number, values in enumerate(answers):
        expected = whole["" if number < 3 else "own"][:, :, number % 3]
        assert np.abs(values[:, :, 0] / expected - 1).max() < 1e-6
    assert np.abs(whole["own"] / whole[""] - 1).max() > 0.05
    files = [row.file for row in input_rows(session)]
    assert ("loaded.xml" in files) == (line == LOADED)


@pytest.mark.parametrize(
    ("line", "state"), [(LOADED, {"added_mass": ADDED}), (POSE, {"shift": 0.12})]
)
def test_stiffness_is_tuned_to_tests_of_both_machines(tmp_path, line, state):
    write_case(tmp_path, {line: state}, scales=SCALES, lines=40)
    tuned, theta = fitted(tmp_path)
    for name, factor in SCALES.items():
        drawn = {"carriage_tx": 3e5, "frame_tx": 5e6, "frame_ry": 4e5}[name]
        assert theta[f"{name}.stiffness"] == pytest.approx(factor * drawn, rel=0.03)
    assert tuned.sensors.gap(tuned.sensors.tuned).excess < 1.1
    # The same data without the key: the tests contradict each other.
    path = tmp_path / "campaign.toml"
    path.write_text(path.read_text(encoding="utf-8").replace(line, ""), encoding="utf-8")
    wrong, _ = fitted(tmp_path)
    assert wrong.sensors.gap(wrong.sensors.tuned).excess > 2


def test_a_known_mass_tells_a_wrong_force_channel_from_heavier_bodies(tmp_path):
    # All force channels read 10 % too little: as if all masses and springs were 10 % smaller.
    gains = dict.fromkeys(("drive", "coil-magnet:+tx", "hit1:+z"), 0.9)
    names = ("hammer(drive).gain", "hammer(coil-magnet:+tx).gain", "hammer(default).gain")
    write_case(tmp_path / "alone", {}, gains=gains, extra=WIDE, lines=40)
    alone_tuning, alone = fitted(tmp_path / "alone")
    write_case(
        tmp_path / "both", {LOADED: {"added_mass": ADDED}}, gains=gains, extra=WIDE, lines=40
    )
    both_tuning, both = fitted(tmp_path / "both")
    for name in names:
        assert alone[name] > 0.93, "without a known mass the masses share the error"
        assert both[name] == pytest.approx(0.9, abs=0.012)
    assert both["carriage.mass"] == pytest.approx(16.0, rel=0.02)
    assert alone["carriage.mass"] > 1.02 * both["carriage.mass"]
    assert both["carriage_tx.stiffness"] == pytest.approx(3e5, rel=0.02)
    assert alone["carriage_tx.stiffness"] > 1.03 * 3e5
    deviations = [
        dict(zip(c.parametrisation.names, c.deviation, strict=True))["hammer(drive).gain"]
        for c in (alone_tuning.confidence, both_tuning.confidence)
    ]
    assert deviations[1] < 0.2 * deviations[0], "in units of the tolerance"


def test_the_other_way_round_heavier_bodies_are_found(tmp_path):
    write_case(
        tmp_path,
        {LOADED: {"added_mass": ADDED}},
        masses=1.1,
        scales=dict.fromkeys(
            ("frame_tx", "frame_tz", "frame_ry", "carriage_tx", "carriage_ry"), 1.1
        ),
        extra=WIDE,
        lines=40,
    )
    _, theta = fitted(tmp_path)
    assert theta["carriage.mass"] == pytest.approx(1.1 * 16.0, rel=0.02)
    assert theta["hammer(drive).gain"] == pytest.approx(1.0, abs=0.012)


def test_a_verdict_uses_tests_of_both_machines(tmp_path):
    case = {LOADED: {"added_mass": ADDED}, POSE: {"shift": 0.12}}
    folder = write_case(tmp_path / "case", case, delays={"encoder": 4e-4}, lines=50)
    target = tmp_path / "verdict.json"
    command = ["diagnose", str(folder), "--json", str(target), "--jobs", "1"]
    result = RUNNER.invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    cause = json.loads(target.read_text(encoding="utf-8"))["causes"][0]
    assert (cause["effect"], cause["location"]) == ("sensor_delay", "sensor:encoder")
    assert (tmp_path / "out" / "report.html").is_file()


def test_pages_are_written_and_modes_are_those_of_each_machine(tmp_path):
    folder = write_case(tmp_path / "case", {LOADED: {"added_mass": ADDED}}, lines=80)
    result = RUNNER.invoke(app, ["tune", str(folder), "--out", str(tmp_path / "tuned")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "tuned" / "report.html").is_file()
    assert "test1.npz was measured with loaded.xml" in result.output
    tuned = json.loads((tmp_path / "tuned" / "tuned.json").read_text(encoding="utf-8"))
    assert [row["variant"] for row in tuned["tests"]] == [""] * 3 + ["loaded.xml"] * 3
    result = RUNNER.invoke(app, ["identify", str(folder), "--out", str(tmp_path / "modes")])
    assert result.exit_code == 0, result.output
    assert "tests with loaded.xml, which have modes of their own" in result.output
    modes = {}
    for name in ("modes", "modes-loaded"):
        content = json.loads((tmp_path / name / "modes.json").read_text(encoding="utf-8"))
        modes[name] = [row["frequency"] for row in content["modes"]]
        assert (tmp_path / name / "identify.html").is_file()
    assert modes["modes-loaded"][0] < 0.97 * modes["modes"][0]
    both = [mb.identify(folder, variant=name).model.freq_hz[0] for name in ("", "loaded.xml")]
    assert both == pytest.approx([modes["modes"][0], modes["modes-loaded"][0]], rel=1e-3)
    with pytest.raises(InputError, match="in several machines"):
        mb.identify(folder)


def test_modes_are_fitted_to_the_machine_of_the_campaign(tmp_path):
    folder = write_case(tmp_path / "case", {LOADED: {"added_mass": ADDED}}, scales=SCALES, lines=80)
    result = RUNNER.invoke(
        app, ["tune", str(folder), "--residual", "modal,log", "--out", str(tmp_path / "tuned")]
    )
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("pose = { spindle = 0.1 }", r"pose names 'spindle', which is no slide or hinge"),
        ('model = "missing.xml"', r"missing\.xml"),
        ('model = "other.xml"', r"other\.xml: its joints are not those of model\.xml"),
        ('pose = { carriage_tx = "far" }', r"test\.2\.pose\.carriage_tx"),
    ],
)
def test_models_and_poses_that_cannot_be_used_are_refused(tmp_path, line, reason):
    folder = write_case(tmp_path, {line: {}}, lines=20)
    text = (folder / "model.xml").read_text(encoding="utf-8")
    (folder / "other.xml").write_text(text.replace("carriage_ry", "carriage_yaw"), encoding="utf-8")
    with pytest.raises(InputError, match=reason):
        open_session(folder)
