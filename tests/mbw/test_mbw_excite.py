"""``mbw excite``: signals under limits, as a campaign that other verbs read, play and grade."""

import csv
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from any_machines import SERVO_AXIS
from browser import CHROMIUM, browse
from encoder_campaign import write_axis

from identification import read_settings
from identification.words import Signal
from mbmodel import Evaluator, FrfRequest, JenkinsElement, as_drawn, write_nonlinear_joints
from mbw.blind.user_test import read_user_test
from mbw.excite.schema import ExcitationFile
from tests.helpers.command import run
from tuning import ParameterConfidence, open_campaign, open_session, predict
from tuning.excitation.tested_machine import open_tested_machine
from tuning.misfit.misfit import Misfit

ROOT = Path(__file__).resolve().parents[2]
LIMITS = """
[drive.drive]
force = 70.0
stroke = 1e-4
speed = 0.02

[drive."coil-magnet:+tx"]
current = 2.0
motor_constant = 12.0

[sensor.encoder]
resolution = 1e-6

[sensor."acc2:+tx"]
noise = 1e-3
"""
SHORT = ("--band", "8", "90", "--seconds", "12", "--rate", "500")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("axis") / "axis.xml"
    write_axis(path)
    (path.parent / "limits.toml").write_text(LIMITS)
    return path


@pytest.fixture(scope="module")
def said(model):
    outputs = ("--output", "encoder", "--output", "acc2:+x")
    return run("excite", model, "--limits", model.with_name("limits.toml"), *outputs, *SHORT)


@pytest.fixture(scope="module")
def folder(model, said):
    del said
    return model.with_name("axis-excited")


@pytest.fixture(scope="module")
def result(folder):
    return json.loads((folder / "excitation.json").read_text())


def read_columns(path):
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], float)


def test_the_terminal_says_limits_intervals_and_what_stays_open(said, folder):
    for words in (
        "multisine for drive, coil-magnet:+tx",
        "100 % of its limit",
        "stiffnesses (D-optimal)",
        "frame_tz.stiffness is not determined",
        "expected: ",
        "mbw tune",
    ):
        assert words in said
    lead = (folder / "excitation.html").read_text().partition('<p class="lead">')[2]
    assert lead.startswith("Designed for all ")


PROBE = """<script>addEventListener("load", () => setTimeout(() => {
  const rows = id => document.querySelectorAll("#" + id + " tbody tr").length;
  const found = document.body.appendChild(document.createElement("pre"));
  found.id = "found";
  found.textContent = JSON.stringify({faults: FAULTS, limits: rows("limits"),
    parameters: rows("parameters"), curves: ["spectrum", "period", "coherence"].map(
      id => document.getElementById(id).data.length)});
}, 500));</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_the_page_shows_limits_intervals_and_curves(folder, result, tmp_path):
    seen = browse((folder / "excitation.html").read_text(), tmp_path, probe=PROBE)
    assert seen == {
        "faults": [],
        "limits": len(result["limits"]),
        "parameters": len(result["parameters"]),
        "curves": [2, 2, 4],
    }


def test_report_writes_the_page_again(folder, tmp_path):
    run("report", folder, "--out", tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text() == (folder / "excitation.html").read_text()


def test_the_json_states_what_is_reached(result):
    assert result["format"] == 1
    ExcitationFile.model_validate(result)
    used = [row["reached"] / row["limit"] for row in result["limits"]]
    assert max(used) == pytest.approx(1)
    assert [row["what"] for row in result["limits"]] == ["force", "stroke", "speed", "current"]
    assert result["realisations"] == 2
    assert result["averages"] == 2 * (result["periods"] - 1)
    assert result["seconds"] <= 12
    assert result["noise"]["acc2:+tx"] == 1e-3
    rows = {row["parameter"]: row for row in result["parameters"]}
    assert rows["carriage_tx.stiffness"]["determined"]
    assert not rows["frame_tz.stiffness"]["determined"]
    assert all(row["interval"][0] < row["nominal"] < row["interval"][1] for row in rows.values())
    assert {(row["drive"], row["output"]) for row in result["coherence"]} == {
        (drive, output)
        for drive in ("drive", "coil-magnet:+tx")
        for output in ("encoder", "acc2:+tx")
    }


def test_the_signal_is_a_table_that_drives_play(folder, result):
    header, table = read_columns(folder / "excitation.csv")
    assert header == ["time", "drive", "coil-magnet:+tx"]
    assert len(table) == round(result["seconds"] * result["rate"])
    np.testing.assert_allclose(np.diff(table[:, 0]), 1 / 500, rtol=1e-6)
    peaks = np.abs(table[:, 1:]).max(axis=0) * [35.0, 1 / 12]  # the gear; the motor constant
    stated = {(row["drive"], row["what"]): row["reached"] for row in result["limits"]}
    assert peaks[0] == pytest.approx(stated["drive", "force"], rel=1e-6)
    assert peaks[1] == pytest.approx(stated["coil-magnet:+tx", "current"], rel=1e-6)


def test_the_folder_is_a_campaign_of_the_expected_record(folder, result):
    _, machine, campaign = open_campaign(folder)
    assert len(campaign.tests) == 2
    for test in campaign.tests:
        estimate = test.estimate
        assert estimate.averages == result["averages"]
        exact = frf(machine, estimate.frf)
        squares = np.abs(estimate.frf.values - exact) ** 2 / estimate.variance
        assert 0.7 < squares.mean() < 1.4


def frf(machine, measured):
    model = as_drawn(machine)
    request = FrfRequest(measured.freq_hz, measured.outputs, measured.inputs, measured.quantity)
    return Evaluator(model, request).at(model.drawn).values


def test_the_control_of_a_motor_is_no_unknown_unit(tmp_path):
    write_axis(tmp_path / "axis.xml")
    arguments = ("--limit", "drive:force=70,stroke=1e-4", "--output", "encoder", "--no-pictures")
    run("excite", tmp_path / "axis.xml", *arguments, *SHORT)
    assert not [r for r in open_campaign(tmp_path / "axis-excited")[2].remarks if "headings" in r]


def test_mujoco_plays_the_signal_into_the_campaign(model, folder, tmp_path):
    """The response takes the place of the expected record: columns have the same headings."""
    copy = tmp_path / "played"
    limits = ("--limits", model.with_name("limits.toml"))
    outputs = ("--output", "encoder", "--output", "acc2:+x")
    run("excite", model, *limits, *outputs, *SHORT, "--out", copy, "--no-pictures")
    before, _ = read_columns(copy / "response.csv")
    played = ("--input", copy / "excitation.csv", "--output", "encoder", "--output", "acc2:+tx")
    run("simulate", copy / "model.xml", *played, "--out", copy, "--overwrite", "--no-pictures")
    after, _ = read_columns(copy / "response.csv")
    assert after == before
    _, machine, campaign = open_campaign(copy)
    for test in campaign.tests:
        exact = frf(machine, test.estimate.frf)
        size = np.sqrt((np.abs(exact) ** 2).mean(axis=0))
        error = np.sqrt((np.abs(test.estimate.frf.values - exact) ** 2).mean(axis=0))
        assert (error < 0.03 * size).all()


CAMPAIGN = """
model = "axis.xml"

[log]
file = "not_recorded_yet.csv"
motors = { drive = "Cmd A" }
encoders = { encoder = "Pos m" }

[loop."x/y"]
input = "drive"
output = "encoder"
controller = { zeros = [-60.0], poles = [-3000.0], gain = 6e4 }
delay = 2e-4

[tolerance]
mass = 0.004

[tuning]
fix = ["frame_tz.*", "acc2.gain_x"]
"""


def test_a_campaign_is_excited_in_its_loops_before_it_is_recorded(model, tmp_path):
    (tmp_path / "axis.xml").write_bytes(model.read_bytes())
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    out = tmp_path / "out"
    run("excite", tmp_path, "--limit", "drive:force=50,stroke=1e-4", *SHORT, "--out", out)
    _, settings = read_settings(out)
    assert settings.tolerance.mass == 0.004
    assert settings.tuning.fix == ["frame_tz.*"]  # the accelerometer is not in this test
    assert settings.log is not None
    assert settings.log.motors == {"drive": "drive [control]"}
    stated, written = (open_tested_machine(path).machine.loops[0] for path in (tmp_path, out))
    laplace = 2j * np.pi * np.array([3.0, 30.0, 200.0])
    np.testing.assert_allclose(
        written.controller.response(laplace), stated.controller.response(laplace), rtol=1e-9
    )
    assert (written.delay, written.input, written.name) == (2e-4, Signal("drive"), "x/y")
    _, machine, campaign = open_campaign(out)
    estimate = campaign.tests[0].estimate
    squares = np.abs(estimate.frf.values - frf(machine, estimate.frf)) ** 2 / estimate.variance
    assert 0.6 < squares.mean() < 1.6
    before = (out / "response.csv").read_bytes()
    played = ("--input", out / "excitation.csv", "--output", "encoder", "--out", out)
    said = run("simulate", out / "model.xml", *played, "--overwrite", code=3)
    assert "closes [loop.*], but this signal is played with x/y open" in said
    assert (out / "response.csv").read_bytes() == before
    said = run("simulate", out, "--closed", "*", *played, "--overwrite", "--no-pictures")
    step = read_settings(out)[1].sensor["encoder"].resolution  # the default: none was stated
    assert f"encoder reads steps of {step:g}" in said
    header, record = read_columns(out / "response.csv")
    counts = record[:, header.index("encoder [m]")] / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-4)
    _, machine, campaign = open_campaign(out)
    for test in campaign.tests:  # the record of MuJoCo with the loop closed is that of the model
        exact = frf(machine, test.estimate.frf)
        error = np.sqrt((np.abs(test.estimate.frf.values - exact) ** 2).mean(axis=0))
        assert (error < 0.03 * np.sqrt((np.abs(exact) ** 2).mean(axis=0))).all()


INSTRUMENTS = """
model = "axis.xml"

[[test]]
file = "not_recorded_yet.npz"
channels = ["acc1:+x", "acc2:+x", "acc2:+z", "encoder"]
references = ["acc1:+x"]

[[test]]
file = "nor_this.npz"
hammer = "other"
channels = ["acc1:+x"]
references = ["hit1:+z"]

[sensor.acc1]
ignore = ["y", "z"]
gain = "unknown"

[sensor.acc2]
flip = ["x"]
turn = [0.0, 0.2, 0.0]
ignore = ["y"]
mass = 0.8

[sensor.encoder]
delay_tolerance = 1e-3

[hammer.default]
gain_tolerance = 0.15
mass = 1.5
stinger = { diameter = 2e-3, length = 0.05 }

[hammer.other]
mass = 1.0

[tuning.prior]
"frame_tz.stiffness" = 0.3
"""


def test_the_instruments_of_a_campaign_are_those_of_its_next_test(model, tmp_path):
    (tmp_path / "axis.xml").write_bytes(model.read_bytes())
    (tmp_path / "campaign.toml").write_text(INSTRUMENTS)
    out = tmp_path / "out"
    said = run("excite", tmp_path, "--limit", "acc1:+x:force=9", *SHORT, "--out", out)
    assert "800 g at acc2, 1500 g at acc1 with a stinger" in said
    assert "[hammer.other] drives nothing in this test" in said
    stated, written = (read_settings(path)[1] for path in (tmp_path, out))
    assert written.test[0].channels == ["encoder", "acc1:+tx", "acc2:+tx", "acc2:+tz"]
    assert written.sensor["acc2"] == stated.sensor["acc2"].model_copy(update={"ignore": []})
    update = {"resolution": 1e-6}  # the default
    assert written.sensor["encoder"] == stated.sensor["encoder"].model_copy(update=update)
    assert written.hammer == {"default": stated.hammer["default"]}
    assert written.tuning.prior == stated.tuning.prior
    session = open_session(out)
    varies, (test,) = session.parametrisation, session.campaign.tests
    exact = predict(session.model, session.model.drawn, session.campaign)[0]
    errors = np.abs(test.estimate.frf.values - exact) ** 2
    free_columns = [0, 2, 3]  # the gain of acc1 was divided out
    assert 0.6 < (errors / test.estimate.variance)[:, free_columns].mean() < 1.6
    x = varies.coordinates(session.model.drawn)
    misfit = Misfit(session.model, session.campaign, varies, model_error_floor=0.0)
    low, high = ParameterConfidence(varies, x, misfit.quadratic_model(x)[2], 1.0).interval()
    names = [parameter.name for parameter in varies.parameters]
    for row in json.loads((out / "excitation.json").read_text())["parameters"]:
        place = names.index(row["parameter"])
        width = np.log(row["interval"][1] / row["interval"][0])
        assert width == pytest.approx(np.log(high[place] / low[place]), rel=0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--drives", ""), "--drives '' names no drive"),
        (("--output", "encoder", "--output", "encoder"), "encoder is encoder once more"),
        (("--output", "acc2:+x", "--output", "acc2:-tx"), "acc2:-tx is acc2:+x once more"),
        (("--limit", "coil-magnet:-x:force=1"), "drive coil-magnet:-x is coil-magnet:+tx once"),
        (("--rate", "1e9"), "--seconds 60 and --rate 1e+09 make a record of"),
        (("--seconds", "1e9"), "lower one of them"),
    ],
)
def test_what_cannot_be_meant_is_refused(model, tmp_path, options, words):
    limits = ("--limits", model.with_name("limits.toml"), "--out", tmp_path / "out")
    assert words in run("excite", model, *limits, *options, code=2)


def test_a_motion_within_one_step_of_the_encoder_is_said(model, tmp_path):
    limits = ("--limit", "drive:force=1e-3", "--resolution", "encoder=1e-6", "--output", "encoder")
    said = run("excite", model, "--drives", "drive", *limits, *SHORT, "--out", tmp_path / "out")
    assert "less than its step of 1e-06: it hardly counts" in said


def test_a_narrow_interval_has_two_ends(model, tmp_path):
    limits = ("--limit", "drive:force=1e3", "--resolution", "encoder=1e-13")
    limits = (*limits, "--output", "encoder", "--out", tmp_path / "out")
    said = run("excite", model, "--drives", "drive", *limits, *SHORT)
    ends = re.findall(r"expected: .* (\S+) to (\S+) ", said)
    assert ends
    assert all(low != high for low, high in ends)


def test_a_drawn_friction_is_said_to_slide_or_stick(model, tmp_path):
    rough = tmp_path / "rough.xml"
    write_nonlinear_joints(model, rough, [JenkinsElement("carriage_tx", 2e5, 1.0)])
    limit = ("--limit", "drive:force=200", *SHORT, "--no-pictures")
    said = run("excite", rough, *limit)
    assert "of the time: it slides all the time" in said
    assert "where it slides, it moves further" in said
    stiff = tmp_path / "stiff.xml"
    write_nonlinear_joints(model, stiff, [JenkinsElement("carriage_tx", 2e5, 500.0)])
    assert "its friction is stiffness" in run("excite", stiff, *limit)


def test_a_diagnosis_with_open_causes_is_excited_for_them(tmp_path):
    folder = tmp_path / "station-diagnosed"
    shutil.copytree(ROOT / "tests/formats/0.2/diagnosed", folder)
    limit = ("--limit", "acc5:+tx:force=50", "--seconds", "12", "--no-pictures")
    outputs = ("--output", "acc1:+x", "--output", "acc8:+x", "--output", "acc8:+z")
    run("excite", folder, *limit, *outputs, "--out", tmp_path / "all")
    verdict = json.loads((folder / "verdict.json").read_text())
    named = [
        ("mass_error", "body:stage", 0.5, {"mass": 2.0}),
        ("appendage", "body:stage", 0.3, {"mass": 1.0, "frequency": 70.0, "damping": 0.02}),
        ("appendage", "body:base", 0.02, {}),
    ]
    verdict["causes"] = [
        {
            "effect": effect,
            "location": location,
            "dof": None,
            "probability": probability,
            "parameters": parameters,
            "interval": {},
            "excess_after": None,
        }
        for effect, location, probability, parameters in named
    ]
    (folder / "verdict.json").write_text(json.dumps(verdict))
    said = run("excite", folder, *limit, *outputs, "--out", tmp_path / "open")
    assert "designed for the open causes mass_error@body:stage, appendage@body:stage" in said
    plain, aimed = (
        json.loads((tmp_path / name / "excitation.json").read_text())["criterion"]
        for name in ("all", "open")
    )
    assert plain["causes"] == []
    assert not {*plain["of"]} & {*aimed["of"]}
    assert aimed["value"] > aimed["flat"]


def test_blind_repeats_a_test_by_a_motor_and_accelerometers(tmp_path):
    model = tmp_path / "servo.xml"
    model.write_text(SERVO_AXIS)
    outputs = [word for n in (1, 2, 4) for word in ("--output", f"acc{n}:+x")]
    limit = ("--limit", "servo:force=2000,stroke=1e-3", "--band", "10", "100", "--seconds", "12")
    run("excite", model, *limit, *outputs, "--no-pictures")
    (test,) = read_user_test(tmp_path / "servo-excited", None).repeated.protocol.measured.tests
    assert test.stated.reference == "servo"
    assert test.stated.channels == ("acc1:+tx", "acc2:+tx", "acc4:+tx")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "no drive is named"),
        (("--drives", "drive"), 3, "--limit drive:force=VALUE"),
        (("--limit", "drive:power=3"), 2, "DRIVE:NAME=VALUE"),
        (("--limit", "drive:force=x"), 2, "DRIVE:NAME=VALUE"),
        (("--limit", "motor:force=3"), 2, "motor"),
        (("--limit", "drive:force=3", "--noise", "encoder"), 2, "LABEL=NUMBER"),
        (("--limit", "drive:force=3", "--kind", "burst"), 2, "multisine, sweep"),
        (("--limit", "drive:force=3", "--seconds", "0.2"), 2, "--seconds 0.2"),
        (("--limits", "missing.toml"), 3, "missing.toml"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(model, tmp_path, arguments, code, words):
    said = run("excite", model, *arguments, "--out", tmp_path / "out", code=code)
    assert words in said
    assert not (tmp_path / "out").exists()
