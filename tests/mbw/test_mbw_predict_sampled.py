"""Sampled controllers through the command: a campaign's loop, and loops of a budget."""

import json

import control
import numpy as np
import pytest
import scipy.io
from budget_case import BUDGET, write_machine, write_tuned_case
from encoder_campaign import CHANNELS, REFERENCES, axis_frfs, write_encoder_campaign

import mbworkbench as mb
from tests.helpers.command import invoke as run
from tuning import open_session
from tuning import tune as tune_campaign

PERIOD, DELAY = 5e-4, 3e-4
SERVO = f"""[loop.servo]
input = "drive"
output = "encoder"
controller = {{ zeros = [0.8], poles = [0.3], gain = 2e4, period = {PERIOD} }}
delay = {DELAY}
"""
SCALES = {"carriage_tx": 1.25, "frame_tx": 0.8}
CONTINUOUS = "controller = {zeros = [-60.0, -8.0], poles = [-0.5, -700.0], gain = 300000.0}"


def servo_law(s):
    z = np.exp(s * PERIOD)
    hold = -np.expm1(-s * PERIOD) / (s * PERIOD)
    return 2e4 * (z - 0.8) / (z - 0.3) * hold * np.exp(-s * DELAY)


def test_a_campaign_with_a_sampled_loop_is_tuned_and_its_loop_closed_again(tmp_path):
    folder, out = tmp_path / "case", tmp_path / "tuned"
    write_encoder_campaign(folder, scales=SCALES, loop=servo_law, extra=SERVO, lines=100)
    session = open_session(folder, (10.0, 160.0))
    tuned = tune_campaign(session)
    names = [parameter.name for parameter in session.model.parameters]
    theta = dict(zip(names, tuned.model_fit.theta, strict=True))
    assert theta["carriage_tx.stiffness"] == pytest.approx(1.25 * 3e5, rel=0.02)
    result = run("tune", folder, "--out", out, "--no-pictures")
    assert result.exit_code == 0, result.output
    assert json.loads((out / "loops.json").read_text())["loops"][0]["period"] == PERIOD
    target = tmp_path / "predicted.json"
    result = run(
        "predict", out, "--input", "drive", "--output", "encoder", "--closed", "servo",
        "--statespace", tmp_path / "closed.npz", "--json", target, "--out", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    (row,) = json.loads(target.read_text())["margins"]["loops"]
    assert row["period"] == PERIOD
    assert "loop servo, sampled every 0.0005 s:" in result.output
    freq = np.geomspace(1.0, 900.0, 60_000)
    column = axis_frfs(freq, SCALES)[:, CHANNELS.index("encoder"), REFERENCES.index("drive")]
    # images of the sampler change the distance by a few thousandths
    true = np.abs(1 + servo_law(2j * np.pi * freq) * column).min()
    assert row["modulus"]["value"] == pytest.approx(true, rel=0.03)


def test_a_budget_takes_a_sampled_mat_file_and_gives_a_page(tmp_path):
    write_tuned_case(tmp_path)
    continuous = control.zpk([-60.0, -8.0], [-0.5, -700.0], 3e5)
    law = control.sample_system(control.ss(control.tf(continuous)), 1e-3, "tustin")
    scipy.io.savemat(
        tmp_path / "law.mat", {"A": law.A, "B": law.B, "C": law.C, "D": law.D, "Ts": 1e-3}
    )
    file = tmp_path / "budget.toml"
    text = file.read_text()
    assert CONTINUOUS in text
    target, place = tmp_path / "out.json", tmp_path / "out"
    rms = []
    for controller in (CONTINUOUS, 'controller = "law.mat"'):
        file.write_text(text.replace(CONTINUOUS, controller))
        command = ["predict", tmp_path / "x-tuned", "--budget", file, "--json", target]
        result = run(*command, "--out", place, "--overwrite")
        assert result.exit_code == 0, result.output
        row = json.loads(target.read_text())["budget"]
        rms.append([error["rms"] for error in row["errors"]])
    assert row["margins"]["loops"][0]["period"] == 1e-3
    assert row["margins"]["machines"] == 60
    assert rms[1] == pytest.approx(rms[0], rel=0.1)
    assert rms[1] != pytest.approx(rms[0], rel=1e-4)
    page = (place / "plant.html").read_text("utf-8")
    assert "sampled every 0.001 s" in page
    assert "driven by disturbances and held controls" in page
    with np.load(place / "margins.npz") as arrays:
        assert arrays["freq_hz"][-1] == pytest.approx(500.0)
        assert arrays["periods"] == pytest.approx([1e-3])


def test_images_of_slow_sampling_are_stated(tmp_path):
    write_machine(tmp_path)
    text = BUDGET.format(gain=1.0, delay=0.0, lines="")
    table = text[text.index("controller") :].splitlines()[0]
    slow = "controller = { zeros = [0.5], poles = [0.1], gain = 1e4, period = 0.005 }"
    noise = 'density = 2e-5\nunit = "m/sqrt(Hz)"\nband = [160.0, 190.0]'
    text = text.replace(table, slow).replace('density = 2e-7\nunit = "m/sqrt(Hz)"', noise)
    text = text.replace("band = [2.0, 45.0]", "band = [2.0, 200.0]")
    (tmp_path / "budget.toml").write_text(text)
    budget = mb.error_budget(tmp_path / "two.xml", tmp_path / "budget.toml")
    assert "images of the sampling rate add" in str(budget)
    result = run("predict", tmp_path / "two.xml", "--budget", tmp_path / "budget.toml",
                 "--out", tmp_path / "out")  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "images of the sampling rate add" in result.output


def test_loops_of_a_campaign_that_mix_periods_have_frfs_but_no_margins(tmp_path):
    damper = SERVO.replace("servo", "damper").replace("2e4, period = 0.0005", "10.0, period = 1e-3")
    assert "1e-3" in damper
    write_encoder_campaign(tmp_path / "case", extra=SERVO + damper, lines=30)
    command = ["predict", tmp_path / "case", "--input", "drive", "--output", "encoder", "--frf"]
    result = run(*command, "--closed", "*", "--band", 5, 160, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "no stability margins: loops that act together must have one sampling" in result.output
