"""Options of ``mbw simulate``: levels that return, and options that do not fit one another."""

import csv
import re
import tomllib
from dataclasses import asdict

import numpy as np
import pytest
import scipy.io
from simulate_command import run, write_pair_model
from small_machine import MJCF

from identification import read_settings
from identification.level_check import group_visits
from mbmodel import HitScatter, Noise
from tuning import open_campaign

SHORT = ("--hits", "2", "--rate", "256", "--block", "0.5", "--jobs", "1")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_pair_model(tmp_path_factory.mktemp("machine"))


def test_a_level_that_returns_is_a_further_visit(model, tmp_path):
    levels = ("--level", 20, "--level", 50.5, "--level", 20, "--setups", 2)
    run(model, "--hammer", "3:+tx", *levels, *SHORT, "--out", tmp_path)
    _, settings = read_settings(tmp_path)
    assert [(test.file, test.level, test.setup) for test in settings.test] == [
        ("hits_20N_a.npz", 20, "a"),
        ("hits_20N_b.npz", 20, "b"),
        ("hits_50.5N_a.npz", 50.5, "a"),
        ("hits_50.5N_b.npz", 50.5, "b"),
        ("hits_20N_visit2_a.npz", 20, "a"),
        ("hits_20N_visit2_b.npz", 20, "b"),
    ]
    _, _, campaign = open_campaign(tmp_path)
    visits = group_visits(campaign)
    assert [level for level, _ in visits] == [20, 50.5, 20]
    assert [len(visited.tests) for _, visited in visits] == [2, 2, 2]


@pytest.fixture(scope="module")
def returning(model):
    out = model.with_name("returning")
    levels = ("--level", 20, "--level", 50, "--level", 20)
    run(model, "--hammer", "3:+tx", "--output", "acc3:+tx", *levels, *SHORT, "--out", out)
    return out


def test_levels_of_a_test_like_another_replace_its_levels(model, returning, tmp_path):
    run(model, "--like", returning, "--level", 11, "--level", 0.5, "--jobs", 1, "--out", tmp_path)
    _, settings = read_settings(tmp_path)
    assert [(test.file, test.level) for test in settings.test] == [
        ("hits_11N_1.npz", 11.0),
        ("hits_0.5N.npz", 0.5),
        ("hits_11N_3.npz", 11.0),
    ]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--level", "11"), "has 2 levels (20 N, 50 N): give --level once for each"),
        (("--hammer", "4"), "--hammer does not apply"),
        (("--output", "acc1:+tx"), "--output does not apply"),
        (("--setups", "2"), "--setups does not apply"),
        (("--setups", "1"), "--setups does not apply"),
    ],
)
def test_what_a_test_like_another_would_ignore_is_refused(model, returning, arguments, words):
    assert words in run(model, "--like", returning, *arguments, code=2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--at", "acc3:+tx"), "--at does not apply to --input"),
        (("--amplitude", "3"), "--amplitude does not apply to --input"),
        (("--duration", "3"), "--duration does not apply to --input"),
        (("--band", "3", "5"), "--band does not apply to --input"),
        (("--rate", "256"), "--rate does not apply to --input"),
        (("--signal", "step"), "--signal does not apply to --input"),
        (("--noise", "0"), "--noise belongs to a hammer test"),
        (("--setups", "1"), "--setups belongs to a hammer test"),
    ],
)
def test_what_a_played_file_would_ignore_is_refused(model, tmp_path, arguments, words):
    signal = tmp_path / "in.csv"
    signal.write_text("time,acc3:+tx\n0,0\n0.001,1\n0.002,0\n", encoding="utf-8")
    assert words in run(model, "--input", signal, *arguments, code=2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--signal", "step", "--band", "5", "9"), "--band does not apply to a step"),
        (("--signal", "step", "--psd", "a.csv"), "--psd does not apply to a step"),
        (("--psd", "a.csv", "--amplitude", "3"), "--amplitude does not apply to --psd"),
        (("--psd", "a.csv", "--band", "3", "5"), "--band does not apply to --psd"),
        (("--signal", "step", "--rate", "-5"), "--rate -5: give a number above 0"),
    ],
)
def test_what_a_signal_would_ignore_is_refused(model, arguments, words):
    assert words in run(model, "--at", "acc3:+tx", *arguments, code=2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--amplitude", "3"), "--amplitude belongs to a played signal"),
        (("--duration", "3"), "--duration belongs to a played signal"),
        (("--band", "3", "5"), "--band belongs to a played signal"),
        (("--quantity", "mobility"), "--quantity belongs to a played signal"),
        (("--rate", "-512"), "--rate -512: give a number above 0"),
        (("--exact", "--noise", "1e-4"), "--noise contradicts --exact"),
        (("--exact", "--aim-scatter", "0.1"), "--aim-scatter contradicts --exact"),
        (("--aim-scatter", "nan"), "--aim-scatter"),
        (("--output", "enc"), "a hammer test records accelerometers"),
        (("--output", "joint:head_tx"), "a hammer test records accelerometers"),
        (("--output", "acc3"), "such as acc1:+tx"),
    ],
)
def test_what_a_hammer_test_would_ignore_is_refused(model, arguments, words):
    assert words in run(model, "--hammer", "3:+tx", *arguments, code=2)


def test_a_nominal_model_without_the_points_of_the_test_is_refused(model, tmp_path):
    nominal = tmp_path / "nominal.xml"
    nominal.write_text(re.sub(r'<site name="acc[26]".*?/>', "", MJCF), encoding="utf-8")
    arguments = (model, "--nominal", nominal, "--hammer", "3:+tx", *SHORT, "--out", tmp_path / "o")
    assert "has no acc2, acc6, where the test measures" in run(*arguments, code=3)
    run(*arguments, "--output", "acc1:+tx")


def test_noise_and_scatter_are_those_of_the_options(model, tmp_path):
    stated = {
        "--noise": 0.02,
        "--force-noise": 0.3,
        "--peak-scatter": 0.4,
        "--pulse-scatter": 0.0,
        "--aim-scatter": 0.03,
        "--place-scatter": 0.0,
    }
    options = [text for name, value in stated.items() for text in (name, value)]
    run(model, "--hammer", "3:+tx", *options, *SHORT, "--hits", 20, "--out", tmp_path)
    answer = tomllib.loads((tmp_path / "answer.toml").read_text())
    assert answer["noise"] == {"motion": 0.02, "force": 0.3}
    assert answer["scatter"] == {
        "peak": 0.4,
        "width": 0.0,
        "angle": 0.03,
        "place": 0.0,
        "double_share": 0.0,
        "bad_share": 0.0,
    }
    with np.load(tmp_path / "hits_200N.npz") as content:
        force, response = content["force"], content["response"]
    # Before the hit there is noise alone, of variance density^2 rate / 2.
    assert response[:, :, :5].std() == pytest.approx(0.02 * np.sqrt(128), rel=0.1)
    assert force[:, :5].std() == pytest.approx(0.3 * np.sqrt(128), rel=0.3)
    assert np.ptp(force.max(axis=1)) > 0.3 * 200


def test_the_help_states_the_defaults_of_noise_and_scatter():
    text = run("--help")
    noise, scatter = asdict(Noise()), asdict(HitScatter())
    for option, value in {
        "--noise": noise["motion"],
        "--force-noise": noise["force"],
        "--peak-scatter": scatter["peak"],
        "--pulse-scatter": scatter["width"],
        "--aim-scatter": scatter["angle"],
        "--place-scatter": scatter["place"],
    }.items():
        default = re.search(rf"{option} .*?Default: ([0-9.e-]+)\.", text)
        assert float(default[1]) == value


def test_a_response_has_columns_and_units_of_sensors(model, tmp_path):
    sensors = (
        '<sensor><jointpos name="enc" joint="head_tx"/><gyro name="imu" site="acc3"/></sensor>'
    )
    machine = tmp_path / "sensors.xml"
    machine.write_text(MJCF.replace("</mujoco>", f"{sensors}</mujoco>"), encoding="utf-8")
    place = ("--signal", "step", "--at", "acc3:+tx", "--duration", 0.1)
    outputs = ("--output", "enc", "--output", "imu.2")
    run(machine, *place, *outputs, "--out", tmp_path / "a")
    with (tmp_path / "a" / "response.csv").open(newline="") as file:
        assert next(csv.reader(file))[2:] == ["enc [m]", "imu.2 [rad/s]"]
    said = run(machine, *place, "--output", "enc", "--format", "mat", "--out", tmp_path / "b")
    assert "1 channel, 206 samples" in said
    content = scipy.io.loadmat(tmp_path / "b" / "response.mat")
    assert content["time_s"].shape == (206, 1)
    assert content["values"].shape == (206, 2)


def test_a_single_hit_is_written_as_a_single_hit(model, tmp_path):
    said = run(model, "--hammer", "3:+tx", *SHORT, "--hits", 1, "--out", tmp_path)
    assert "1 hit, 1 file" in said
