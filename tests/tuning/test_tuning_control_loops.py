"""Campaigns whose control loops were closed: tuned, exported open and closed, and refused.

The data come from matrices written by hand, and the loop is closed on them by hand.
"""

import json

import numpy as np
import pytest
import scipy.io
from encoder_campaign import CHANNELS, REFERENCES, axis_frfs, close_servo, write_encoder_campaign
from typer.testing import CliRunner

import mbworkbench as mb
from identification.words import InputError, UsageError
from mbw.command import app
from tuning import open_session
from tuning import tune as tune_campaign
from tuning.files.input_files import input_rows

RUNNER = CliRunner()
KP, KD, CORNER, DELAY = 6e3, 15.0, 2 * np.pi * 400, 3e-4
SCALES = {"carriage_tx": 1.25, "frame_tx": 0.8}
SERVO = (
    '[loop.servo]\ninput = "drive"\noutput = "encoder"\n'
    f"controller = {{ zeros = [{-KP / KD}], poles = [{-CORNER}], gain = {KD * CORNER} }}\n"
    f"delay = {DELAY}\n"
)


def servo_law(s):
    return (KP + KD * s) / (1 + s / CORNER) * np.exp(-s * DELAY)


def tuned_stiffness(folder):
    session = open_session(folder, (10.0, 160.0))
    tuned = tune_campaign(session)
    names = [parameter.name for parameter in session.model.parameters]
    theta = dict(zip(names, tuned.model_fit.theta, strict=True))
    return tuned, theta


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    """A campaign that was measured with its servo on, and its tuning by the command."""
    folder = tmp_path_factory.mktemp("servo") / "campaign"
    write_encoder_campaign(folder, scales=SCALES, loop=servo_law, extra=SERVO, lines=120)
    out = folder.parent / "tuned"
    result = RUNNER.invoke(app, ["tune", str(folder), "--out", str(out), "--no-pictures"])
    assert result.exit_code == 0, result.output
    return folder, out


def test_stiffness_is_found_with_the_loop_known_and_wrong_without_it(closed, tmp_path):
    tuned, theta = tuned_stiffness(closed[0])
    assert theta["carriage_tx.stiffness"] == pytest.approx(1.25 * 3e5, rel=0.02)
    assert theta["frame_tx.stiffness"] == pytest.approx(0.8 * 5e6, rel=0.02)
    assert tuned.sensors.gap(tuned.sensors.tuned).excess < 1.1
    write_encoder_campaign(tmp_path, scales=SCALES, loop=servo_law, lines=120)
    _, wrong = tuned_stiffness(tmp_path)
    # The servo's 35 x 6e3 N/m stand in parallel to the spring, and no gap tells.
    assert wrong["carriage_tx.stiffness"] > 1.4 * 1.25 * 3e5


def test_the_folder_of_the_tuning_holds_the_loop(closed):
    _, out = closed
    stored = json.loads((out / "loops.json").read_text(encoding="utf-8"))["loops"]
    assert [row["name"] for row in stored] == ["servo"]
    tuned = json.loads((out / "tuned.json").read_text(encoding="utf-8"))
    assert any("loop:servo" in text for text in tuned["not_held_by_mjcf"])
    assert tuned["fit"]["trusted"], tuned["fit"]["doubts"]


def test_plants_are_exported_with_the_loop_open_unless_it_is_named(closed):
    _, out = closed
    freq = np.linspace(8.0, 160.0, 80)
    whole = axis_frfs(freq, SCALES)
    shut = close_servo(whole, servo_law(2j * np.pi * freq))
    row, column = CHANNELS.index("acc2:+x"), REFERENCES.index("drive")
    for names, expected in (((), whole), (("servo",), shut), ("*", shut)):
        plant = mb.read_plant(out, "acc2:+x", "drive", freq, closed=names)
        values = plant.bands().values[:, 0, 0]
        error = np.linalg.norm(values - expected[:, row, column])
        assert error < 0.03 * np.linalg.norm(expected[:, row, column])
        system = plant.state_space().to_control()
        assert np.abs(system(2j * np.pi * freq) - values).max() < 1e-4 * np.abs(values).max()
        assert f"loop servo {'closed' if names else 'open'}" in repr(plant)
    assert np.linalg.norm(whole - shut) > 0.3 * np.linalg.norm(shut)
    with pytest.raises(UsageError, match=r"'spindle' is no loop .* \(there are servo\)"):
        mb.read_plant(out, "acc2:+x", "drive", freq, closed=["spindle"])


@pytest.mark.parametrize("machine", ["campaign", "tuned"])
def test_predict_says_which_loops_are_closed(closed, machine, tmp_path):
    folder = closed[0] if machine == "campaign" else closed[1]
    ports = ["--output", "acc2:+tx", "--input", "drive", "--no-pictures", "--modes"]
    command = ["predict", str(folder), *ports, "--band", "8", "160", "--json"]
    texts, modes = {}, {}
    for name, option in (("open", []), ("closed", ["--closed", "servo"])):
        target = tmp_path / f"{name}.json"
        file = tmp_path / f"{name}.mat"
        result = RUNNER.invoke(app, [*command, str(target), "--statespace", str(file), *option])
        assert result.exit_code == 0, result.output
        texts[name] = json.loads(target.read_text(encoding="utf-8"))
        modes[name] = [mode["frequency"] for mode in texts[name]["modes"]]
        assert f"servo {name}" in result.output
        assert ("closed_loops" in scipy.io.loadmat(file)) == (name == "closed")
    assert any("servo open" in text for text in texts["open"]["remarks"])
    assert max(modes["closed"][:5]) > max(modes["open"][:5])
    result = RUNNER.invoke(app, [*command, str(tmp_path / "x.json"), "--closed", "spindle"])
    assert result.exit_code == 2
    assert "is no loop that was closed during the test" in result.output


def test_a_budget_closes_a_loop_of_the_test_once(closed, tmp_path):
    _, out = closed
    text = (
        '[error.x]\noutput = "acc2:+tx"\n[disturbance.hit]\ninput = "hit1:+tz"\ndensity = 1.0\n'
        'unit = "N/sqrt(Hz)"\nband = [8.0, 160.0]\n'
    )
    budget, own = tmp_path / "budget.toml", tmp_path / "own.toml"
    budget.write_text(text, encoding="utf-8")
    own.write_text(text + SERVO, encoding="utf-8")
    rms = {
        "open": mb.error_budget(out, budget).rms["x"],
        "closed": mb.error_budget(out, budget, closed="servo").rms["x"],
        "own": mb.error_budget(out, own).rms["x"],
    }
    assert rms["closed"] == pytest.approx(rms["own"], rel=1e-9)
    assert abs(rms["open"] / rms["closed"] - 1) > 0.02
    with pytest.raises(InputError, match=r"loop\.servo .* count twice"):
        mb.error_budget(out, own, closed="*")


def test_a_closed_loop_of_the_test_has_margins_without_a_budget(closed, tmp_path):
    _, out = closed
    target = tmp_path / "margins.json"
    command = ["predict", str(out), "--json", str(target), "--out", str(tmp_path / "out")]
    result = RUNNER.invoke(app, [*command, "--closed", "servo"])
    assert result.exit_code == 0, result.output
    margins = json.loads(target.read_text(encoding="utf-8"))["margins"]
    assert margins["machines"] == 60
    (row,) = margins["loops"]
    freq = np.geomspace(1.0, 500.0, 100_000)
    column = axis_frfs(freq, SCALES)[:, CHANNELS.index("encoder"), REFERENCES.index("drive")]
    true = np.abs(1 + servo_law(2j * np.pi * freq) * column).min()
    assert row["modulus"]["value"] == pytest.approx(true, rel=0.03)
    assert row["modulus"]["low"] < row["modulus"]["value"] < row["modulus"]["high"]
    assert row["robust"] == []  # errors of FRFs with the loop closed are not those of its plant
    assert f"modulus {row['modulus']['value']:.3g} at" in result.output
    with np.load(tmp_path / "out" / "margins.npz") as file:
        assert 1 / np.abs(1 / (1 + file["loop_gain"])).max() == pytest.approx(
            row["modulus"]["value"], rel=1e-3
        )
    result = RUNNER.invoke(app, [*command, "--no-pictures"])
    assert "margins" not in json.loads(target.read_text(encoding="utf-8"))


def test_a_verdict_with_the_loop_known_names_a_payload(tmp_path):
    write_encoder_campaign(
        tmp_path / "case",
        scales={"carriage_tx": 1.2},
        added_mass=3.0,
        loop=servo_law,
        extra=SERVO,
        lines=60,
    )
    target = tmp_path / "verdict.json"
    command = ["diagnose", str(tmp_path / "case"), "--json", str(target), "--jobs", "1"]
    result = RUNNER.invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    cause = json.loads(target.read_text(encoding="utf-8"))["causes"][0]
    assert (cause["effect"], cause["location"]) == ("mass_error", "body:carriage")
    low, high = cause["interval"]["mass"]
    assert low < 3.0 < high
    assert (tmp_path / "out" / "loops.json").is_file()


def test_identify_reads_the_campaign_with_its_loop(closed, tmp_path):
    result = RUNNER.invoke(app, ["identify", str(closed[0]), "--out", str(tmp_path / "modes")])
    assert result.exit_code == 0, result.output
    model, like = str(closed[0] / "model.xml"), ["--like", str(closed[0])]
    result = RUNNER.invoke(app, ["simulate", model, *like, "--out", str(tmp_path / "simulated")])
    assert result.exit_code == 3
    assert "loop.servo was closed during the test" in result.output


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('input = "drive"', 'input = "engine"', r"loop\.servo: 'engine' is no motor of the model"),
        ('output = "encoder"', 'output = "ruler"', r"loop\.servo: 'ruler' is no sensor"),
        ("controller = {", 'controller = "pid.mat"\n# {', r"pid\.mat.*name a \.mat file"),
        ("gain = 3", "gain = -3", r"with the opposite sign of loop\.servo it would be stable"),
        ("delay = 0.0003", "delay = 3.0", r"loop\.servo\.delay = 3\.0"),
        (
            " gain = 3",
            " period = 2.5, gain = 3",
            r"loop\.servo\.controller\.period = 2\.5: Input",
        ),
        (" gain = 3", " gan = 3", r"unknown key loop\.servo\.controller\.gan: did you mean gain"),
        (
            "controller = {",
            "controller = 3.0\n# {",
            r"loop\.servo\.controller = 3\.0: Input",
        ),
        ("delay = 0.0003", "lag = 3e-4", r"unknown key loop\.servo\.lag"),
        ('input = "drive"', 'input = "floor:+tx"', r"drives the floor"),
        ('output = "encoder"', 'output = "encoder"\nminus = "carriage:+ry"', r"subtracts"),
    ],
)
def test_loops_that_cannot_be_used_are_refused_by_name(tmp_path, old, new, reason):
    write_encoder_campaign(tmp_path, extra=SERVO, lines=40)
    path = tmp_path / "campaign.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=reason) as refused:
        open_session(tmp_path)
    assert str(tmp_path) in str(refused.value)


def test_an_unstable_nominal_loop_is_a_remark_if_it_is_stated_as_right(tmp_path):
    turned = SERVO.replace("gain = 3", "gain = -3") + "as_stated = true\n"
    write_encoder_campaign(tmp_path, extra=turned, lines=40)
    remarks = open_session(tmp_path).campaign.remarks
    assert any("loop.servo closed is unstable" in remark for remark in remarks)


def test_a_controller_file_is_read_and_is_an_input_of_the_result(tmp_path):
    poles, zeros = np.array([-CORNER]), np.array([-KP / KD])
    extra = SERVO.splitlines()
    extra[3] = 'controller = "pid.mat"'
    write_encoder_campaign(tmp_path, loop=servo_law, extra="\n".join(extra), lines=40)
    scipy.io.savemat(tmp_path / "pid.mat", {"zeros": zeros, "poles": poles, "gain": KD * CORNER})
    session = open_session(tmp_path)
    s = 2j * np.pi * np.array([10.0, 100.0])
    law = session.model.machine.loops[0].controller.response(s) * np.exp(-s * DELAY)
    assert law == pytest.approx(servo_law(s), rel=1e-9)
    assert "pid.mat" in [row.file for row in input_rows(session)]
