"""``mbw simulate``: a virtual hammer test that other verbs read, and played signals."""

import csv
import json
import re
import tomllib

import numpy as np
import pytest
import scipy.io
from PIL import Image, ImageSequence
from simulate_command import run, write_pair_model
from small_machine import MJCF
from typer.testing import CliRunner

from identification import read_settings
from mbmodel import (
    DryFriction,
    GapSpring,
    JenkinsElement,
    PolynomialSpring,
    as_drawn,
    load_machine,
    model_modes,
    read_nonlinear_joints,
    write_nonlinear_joints,
)
from mbw.command import app
from mbw.simulate import hammer_plan
from mbw.simulate.imitated_test import name_records
from tuning import open_campaign

RUNNER = CliRunner()
SHORT = ("--hits", "3", "--rate", "256", "--block", "0.5", "--jobs", "1")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_pair_model(tmp_path_factory.mktemp("machine"))


@pytest.fixture(scope="module")
def campaign(model):
    out = model.with_name("test")
    levels = ("--level", "20", "--level", "50", "--setups", "2")
    run(model, "--hammer", "3:-ty", "--hammer", "acc4:+tz", *levels, *SHORT, "--out", out)
    return out


def test_a_virtual_test_is_a_campaign_with_levels_and_setups(campaign):
    _, settings = read_settings(campaign)
    assert {(test.level, test.setup) for test in settings.test} == {
        (20.0, "a"),
        (20.0, "b"),
        (50.0, "a"),
        (50.0, "b"),
    }
    _, machine, tests = open_campaign(campaign)
    assert machine.name == "pair"
    assert len(tests.tests) == 8
    assert {str(test.condition.reference) for test in tests.tests} == {"acc3:-ty", "acc4:+tz"}
    # Of three hits the identification may leave out one whose aim was off.
    assert all(len(test.hits.kept) + len(test.hits.rejected) == 3 for test in tests.tests)
    peaks = [abs(hit.peak_n) for test in tests.tests[4:] for hit in test.hits.kept]
    assert 30 < np.mean(peaks) < 55


def test_identify_finds_the_modes_of_the_model(campaign, tmp_path):
    result = RUNNER.invoke(
        app, ["identify", str(campaign), "--out", str(tmp_path / "modes"), "--no-pictures"]
    )
    assert result.exit_code == 0, result.output
    modes = json.loads((tmp_path / "modes" / "modes.json").read_text())["modes"]
    assert [mode["frequency"] for mode in modes][:2] == pytest.approx([45.67, 65.9], rel=5e-3)


def test_the_answer_holds_the_drawn_errors(campaign):
    answer = tomllib.loads((campaign / "answer.toml").read_text())
    assert len(answer["sensor"]) == 6
    gains = np.array([sensor["gains"] for sensor in answer["sensor"].values()])
    assert 0.003 < np.std(gains - 1) < 0.03
    assert set(answer["hammer"]) == {"acc3:+ty", "acc4:+tz"}


def test_a_test_like_another_has_its_channels_lines_and_tolerances(model, campaign, tmp_path):
    summary = tmp_path / "summary.json"
    run(
        model,
        "--like",
        campaign,
        "--exact",
        "--jobs",
        1,
        "--out",
        tmp_path / "a",
        "--json",
        summary,
    )
    _, _, first = open_campaign(campaign, (10.0, 90.0))
    _, _, second = open_campaign(tmp_path / "a", (10.0, 90.0))
    assert np.array_equal(first.freq_hz, second.freq_hz)
    for one_test, like_it in zip(first.tests, second.tests, strict=True):
        assert one_test.condition.reference == like_it.condition.reference
        assert one_test.condition.setup == like_it.condition.setup
        assert one_test.estimate.frf.outputs == like_it.estimate.frf.outputs
    assert second.tolerance.sensor_gain == 0.0
    assert second.tolerance.mass == first.tolerance.mass
    content = json.loads(summary.read_text())
    assert content["hits"] == 24
    assert content["error"] < 3e-3


@pytest.mark.parametrize("kind", ["step", "chirp", "noise"])
def test_a_signal_is_played(model, tmp_path, kind):
    place = ("--signal", kind, "--at", "acc3:+tx", "--duration", 0.5, "--amplitude", 30)
    run(model, *place, "--output", "head:+tx", "--output", "joint:head_tx", "--out", tmp_path)
    with (tmp_path / "response.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["time [s]", "acc3:+tx [N]", "head:+tx [m/s^2]", "joint:head_tx [m]"]
    table = np.array(rows, float)
    assert len(table) == 1025
    if kind == "step":  # long after, the joint carries 30 N
        assert table[-1, 3] == pytest.approx(30 / 8e6, rel=0.1)
    if kind == "noise":
        assert table[:, 1].std() == pytest.approx(30, rel=0.2)


def test_a_csv_is_played_into_a_mat_file(model, tmp_path):
    signal = tmp_path / "in.csv"
    time = np.arange(0, 0.3, 1e-3)
    force = 10 * np.sin(2 * np.pi * 20 * time)
    lines = [f"{t:.6f},{f:.6f}" for t, f in zip(time, force, strict=True)]
    signal.write_text("time,floor:+tx\n" + "\n".join(lines), encoding="utf-8")
    quantity = ("--quantity", "receptance", "--format", "mat")
    run(model, "--input", signal, *quantity, "--output", "base:+tx", "--out", tmp_path / "o")
    content = scipy.io.loadmat(tmp_path / "o" / "response.mat")
    assert content["values"].shape == (300, 2)
    assert np.abs(content["values"][:, 1]).max() > 1e-4


def test_a_power_density_is_played(model, tmp_path):
    table = tmp_path / "psd.csv"
    table.write_text("freq,density\n10,0\n20,1\n60,1\n70,0\n", encoding="utf-8")
    place = ("--psd", table, "--at", "floor:+tz", "--duration", 4, "--rate", 512, "--seed", 3)
    run(model, *place, "--output", "base:+tz", "--format", "npz", "--out", tmp_path / "o")
    with np.load(tmp_path / "o" / "response.npz") as content:
        signal = content["values"][:, 0]
    # 40 Hz of density 1 and two ramps of 10 Hz: a mean square of 50.
    assert (signal**2).mean() == pytest.approx(50, rel=0.2)


def test_dry_friction_needs_a_nominal_model(model, tmp_path):
    rough = tmp_path / "rough.xml"
    write_nonlinear_joints(model, rough, [DryFriction("head_tx", 0.1)])
    out = tmp_path / "rough-test"
    assert "--nominal" in run(rough, "--hammer", "3", *SHORT, "--out", out, code=3)
    run(rough, "--hammer", "3:+tx", *SHORT, "--nominal", model, "--out", out)
    assert "frictionloss" not in (out / "model.xml").read_text()
    open_campaign(out)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "no hammer point"),
        (("--hammer", "99"), "ends in 99"),
        (("--hammer", "nothing"), "neither a point nor a body"),
        (("--hammer", "3", "--setups", "9"), "at most as many"),
        (("--hammer", "3", "--rate", "-1"), "rate"),
        (("--hammer", "3", "--rate", "1"), "the lowest mode"),
        (("--hammer", "3", "--block", "0.01"), "samples"),
        (("--hammer", "3", "--block", "0"), "above 0"),
        (("--hammer", "3", "--pulse", "0"), "above 0"),
        (("--signal", "sine", "--at", "acc3:+tx"), "one of step"),
        (("--signal", "step"), "--at"),
        (("--signal", "step", "--at", "acc3:+tx", "--hits", "3"), "--hits"),
        (("--signal", "chirp", "--at", "acc3:+tx", "--band", "50", "9"), "lower frequency first"),
        (("--signal", "step", "--at", "joint:none"), "joint:none"),
        (("--hammer", "3", "--format", "csv"), "--format"),
        (("--hammer", "3", "--block", "nan"), "samples"),
        (("--hammer", "3", "--hits", "1000", "--block", "900"), "GB of records"),
        (("--hammer", "3", "--output", "acc1:+tx", "--output", "acc1:-tx"), "twice"),
        (("--signal", "step", "--at", "acc3:+tx", "--duration", "nan"), "samples"),
        (("--at", "acc3:+tx"), "add --signal"),
    ],
)
def test_a_wrong_call_ends_with_one_sentence(model, arguments, words):
    assert words in run(model, *arguments, code=2)


def test_a_wrong_table_is_refused_with_its_row(model, tmp_path):
    signal = tmp_path / "in.csv"
    signal.write_text("time,acc3:+tx\n0,1\n0.001,x\n", encoding="utf-8")
    assert "row 3" in run(model, "--input", signal, code=3)
    signal.write_text("time,acc3:+tx\n0,1\n0.001,nan\n", encoding="utf-8")
    assert "finite" in run(model, "--input", signal, code=3)
    signal.write_text("time,acc3:+tx\n0,1\n1,1\n2,1\n4,1\n", encoding="utf-8")
    assert "evenly spaced" in run(model, "--input", signal, code=3)


@pytest.mark.parametrize(
    ("law", "kind"),
    [
        ("head_tx:friction:k=4e6,limit=20", JenkinsElement),
        ("head_tx:friction:limit=2", DryFriction),
        ("head_tx:backlash:gap=1e-7", GapSpring),
        ("head_tx:hardening:k3=1e18", PolynomialSpring),
    ],
)
def test_a_joint_is_made_nonlinear_and_the_campaign_names_the_drawing(model, tmp_path, law, kind):
    out = tmp_path / "o"
    run(model, "--law", law, "--hammer", "3:+tx", *SHORT, "--hits", 2, "--out", out)
    (read,) = read_nonlinear_joints(out / "simulated.xml")
    assert isinstance(read, kind)
    assert read_nonlinear_joints(out / "model.xml") == ()
    answer = tomllib.loads((out / "answer.toml").read_text())
    assert answer["effect"] == law.split(":")[1]
    assert answer["joint"][0]["joint"] == "head_tx"
    open_campaign(out)


def test_hardening_raises_the_frequency_with_the_level(model, tmp_path):
    # The joint moves by some 1e-5 m at 500 N, so that k3 x^2 is some 5 % of its stiffness.
    law = ("--law", "head_tx:hardening:k3=5e15", "--exact", "--hits", 1, "--rate", 512)
    levels = ("--level", "5", "--level", "1500")
    run(model, *law, *levels, "--hammer", "3:+tx", "--block", 2, "--jobs", 1, "--out", tmp_path)
    _, _, campaign = open_campaign(tmp_path, (20.0, 190.0))
    frfs = [np.abs(test.estimate.frf.values[:, 6, 0]) for test in campaign.tests]
    centres = [(frf**2 @ campaign.freq_hz) / (frf**2).sum() for frf in frfs]
    assert centres[1] > 1.003 * centres[0]


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("nothing:friction:limit=1", "no slide or hinge 'nothing'"),
        ("head_tx:creep:limit=1", "one of friction"),
        ("head_tx:friction:k=1e6", "has limit"),
        ("head_tx:friction:limit=much", "NAME=VALUE"),
        ("head_tx:friction:limit=-1", "above 0"),
    ],
)
def test_a_wrong_law_is_refused(model, law, words):
    assert words in run(model, "--law", law, code=2)


def test_two_laws_of_one_spring_are_refused(model):
    laws = ("--law", "head_tx:hardening:k3=1e14", "--law", "head_tx:backlash:gap=1e-6")
    assert "'head_tx' has two laws of its own spring" in run(model, *laws, code=2)


def test_a_law_without_bound_is_named_in_place_of_a_temporary_file(model):
    law = "head_tx:hardening:k3=-1e20"
    place = ("--signal", "step", "--at", "acc3:+tx", "--duration", 0.2, "--amplitude", 3000)
    text = run(model, "--law", law, *place, code=4)
    assert f"pair.xml --law {law}" in text
    assert "joint 'head_tx' has a polynomial spring" in text
    assert "simulated.xml" not in text


def test_a_gap_that_stays_open_is_remarked_beside_the_step(model, tmp_path):
    law = ("--law", "head_tx:backlash:gap=1", "--hammer", "3:+tx", *SHORT)
    text = run(model, *law, "--out", tmp_path / "o")
    assert "never reaches a stop of its gap" in text
    page = (tmp_path / "o" / "simulate.html").read_text(encoding="utf-8")
    assert "never reaches a stop of its gap" in page


def test_a_played_signal_becomes_a_moving_picture_and_a_page(model, tmp_path, monkeypatch):
    monkeypatch.setattr("mbw.simulate.animation._PICTURE_COUNT", 10)  # rendering takes long
    target = tmp_path / "motion.gif"
    place = ("--signal", "step", "--at", "acc3:+tx", "--duration", 0.2, "--amplitude", 30)
    run(model, *place, "--animate", target, "--out", tmp_path / "o")
    with Image.open(target) as file:
        frames = [np.asarray(frame.convert("L"), float) for frame in ImageSequence.Iterator(file)]
    assert len(frames) == 10
    below = [frame[60:] for frame in frames]  # the caption changes always
    assert max(float((np.abs(frame - below[0]) > 40).mean()) for frame in below) > 1e-3
    page = (tmp_path / "o" / "simulate.html").read_text(encoding="utf-8")
    assert "estimated error" in page
    assert '"label": "acc3:+tx"' in page
    assert "--animate" in run(model, "--hammer", "3", "--animate", target, code=2)


@pytest.mark.parametrize("factor", [1e-6, 0.05, 1.0, 30.0, 1e4])
def test_the_default_rate_holds_all_modes_and_the_record_the_slow_ones(tmp_path, factor):
    scaled = re.sub(
        r'(stiffness|damping)="([^"]+)"',
        lambda found: f'{found[1]}="{float(found[2].split()[0]) * factor:.9g}"',
        MJCF,
    )
    (tmp_path / "scaled.xml").write_text(scaled, encoding="utf-8")
    machine = load_machine(tmp_path / "scaled.xml")
    modes = model_modes(as_drawn(machine), as_drawn(machine).drawn)
    top = hammer_plan.highest_separate_mode(
        modes.freq_hz[modes.oscillates], modes.damping[modes.oscillates]
    )
    rate = hammer_plan._default_rate(machine)
    assert rate == max(512.0, np.ceil(1.2 * 2.56 * top))
    block = hammer_plan._default_block(machine, rate)
    assert np.log2(block * rate) == pytest.approx(round(np.log2(block * rate)), abs=1e-9)
    assert 2048 <= round(block * rate) <= 16384
    if rate == 512.0:
        assert block == 4.0


def test_the_default_band_ends_where_modes_overlap():
    sparse, crowded = np.array([10.0, 20.0, 45.0, 90.0]), np.array([300.0, 310.0, 330.0, 350.0])
    freq_hz = np.concatenate([sparse, crowded])
    # Half-power bandwidths of 0.15 f fill the octave about 330 Hz, but not that about 90 Hz.
    assert hammer_plan.highest_separate_mode(freq_hz, np.full(8, 0.15)) == 90.0
    assert hammer_plan.highest_separate_mode(freq_hz, np.full(8, 0.01)) == 350.0
    assert hammer_plan.highest_separate_mode(freq_hz, np.full(8, 0.5)) == 0.0


def test_files_of_one_name_in_several_folders_stay_apart():
    names = name_records(["a/hits.uff", "b/hits.uff", "b/hits.mat", "../c.uff"], ".npz")
    assert names == ["a_hits.npz", "b_hits_2.npz", "b_hits_3.npz", "c.npz"]
