"""A feed axis measured from motors and force pairs to encoders: tuned, and its fault named.

The data come from matrices written by hand (``tests.helpers.encoder_campaign``).
"""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from identification.words import InputError
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine, parse_input, parse_output
from mbw.command import app
from tests.helpers.encoder_campaign import (
    CHANNELS,
    REFERENCES,
    axis_frfs,
    write_axis,
    write_encoder_campaign,
)
from tuning import open_session
from tuning import tune as tune_campaign

RUNNER = CliRunner()
UNKNOWN = '[sensor.encoder]\ngain = "unknown"\n[hammer.drive]\ngain = "unknown"\n'


def test_motors_pairs_and_hits_to_encoders_equal_matrices_written_by_hand(tmp_path):
    write_axis(tmp_path / "axis.xml")
    machine, freq = load_machine(tmp_path / "axis.xml"), np.linspace(4.0, 180.0, 40)
    request = FrfRequest(
        freq,
        tuple(parse_output(machine, text) for text in CHANNELS),
        tuple(parse_input(machine, text) for text in REFERENCES),
    )
    values = Evaluator(as_drawn(machine), request).at(as_drawn(machine).drawn).values
    assert np.abs(values / axis_frfs(freq, {}) - 1).max() < 1e-9


def test_unknown_gains_of_motor_and_encoder_are_found_with_the_springs(tmp_path):
    gains = {"encoder": -2.5e6, "drive": 3.1}
    scales = {"carriage_tx": 1.3, "frame_tx": 0.8}
    write_encoder_campaign(tmp_path, scales=scales, gains=gains, extra=UNKNOWN)
    session = open_session(tmp_path, (10.0, 160.0))
    tuned = tune_campaign(session)
    names = [parameter.name for parameter in session.model.parameters]
    theta = dict(zip(names, tuned.model_fit.theta, strict=True))
    found = {
        gain.location.partition(":")[2]: gain.value * theta[gain.parameter]
        for gain in session.campaign.unknown_gains.nominal
    }
    assert found == pytest.approx(gains, rel=0.02)
    assert theta["carriage_tx.stiffness"] == pytest.approx(1.3 * 3e5, rel=0.04)
    assert theta["frame_tx.stiffness"] == pytest.approx(0.8 * 5e6, rel=0.04)
    assert tuned.sensors.gap(tuned.sensors.tuned).excess < 1.1


def test_a_verdict_names_the_fault_of_a_body(tmp_path):
    # The delay of an encoder is named in ``tuning/test_tuning_test_models.py``.
    write_encoder_campaign(
        tmp_path / "case", scales={"carriage_tx": 1.2}, lines=60, added_mass=3.0, extra=UNKNOWN
    )
    target = tmp_path / "verdict.json"
    command = ["diagnose", str(tmp_path / "case"), "--json", str(target), "--jobs", "1"]
    result = RUNNER.invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    cause = json.loads(target.read_text(encoding="utf-8"))["causes"][0]
    assert (cause["effect"], cause["location"]) == ("mass_error", "body:carriage")
    assert cause["probability"] > 0.9
    low, high = cause["interval"]["mass"]
    assert low < 3.0 < high
    assert high - low < 3.0


def test_a_tolerance_of_one_instrument_is_its_prior(tmp_path):
    extra = (
        "[sensor.encoder]\ngain_tolerance = 0.3\ndelay_tolerance = 1e-3\n"
        '[hammer."coil-magnet:x"]\ngain_tolerance = 0.2\n'
    )
    write_encoder_campaign(tmp_path, extra=extra)
    parametrisation = open_session(tmp_path).parametrisation
    scale = {
        parameter.name: value
        for parameter, value in zip(parametrisation.parameters, parametrisation.scale, strict=True)
    }
    assert scale["encoder.gain"] == pytest.approx(0.3)
    assert scale["encoder.delay"] == pytest.approx(1e-3)
    assert scale["hammer(coil-magnet:+tx).gain"] == pytest.approx(0.2)
    assert scale["acc2.gain_x"] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("'encoder'", "'resolver'", "channel 'resolver' is no sensor of the model"),
        ("'drive'", "'engine'", "reference 'engine' is no motor of the model"),
        ("coil-magnet", "coil-nowhere", "neither a point, a pair"),
        ("joint:frame_tx", "joint:nowhere", "no slide or hinge of this name"),
    ],
)
def test_a_port_that_the_model_lacks_is_refused_by_name(tmp_path, old, new, reason):
    write_encoder_campaign(tmp_path)
    path = tmp_path / "campaign.toml"
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=reason):
        open_session(tmp_path)


def test_settings_of_a_channel_that_nothing_reads_are_refused(tmp_path):
    write_encoder_campaign(tmp_path, extra='[sensor.resolver]\ngain = "unknown"\n')
    with pytest.raises(InputError, match=r"sensor\.resolver: the model has no site 'resolver'"):
        open_session(tmp_path)


LATE = 1.2e-3  # half a turn at 417 Hz, 69 degrees at the last line


@pytest.mark.parametrize(("place", "factor"), [("drive", -3.1), ("encoder", -2.5e6)])
def test_a_late_drive_or_encoder_of_unknown_gain_has_its_sign_and_delay(tmp_path, place, factor):
    table = "[sensor.encoder]" if place == "encoder" else "[hammer.drive]"
    extra = UNKNOWN.replace(table, f"{table}\ndelay_tolerance = 2e-3")
    write_encoder_campaign(
        tmp_path,
        scales={"carriage_tx": 1.3, "frame_tx": 0.8},
        gains={place: factor},
        delays={place: LATE},
        extra=extra,
    )
    target = tmp_path / "out" / "tuned.json"
    result = RUNNER.invoke(
        app, ["tune", str(tmp_path), "--out", str(tmp_path / "out"), "--no-pictures"]
    )
    assert result.exit_code == 0, result.output
    tuned = json.loads(target.read_text(encoding="utf-8"))
    (row,) = [each for each in tuned["channel_gains"] if each["location"].endswith(f":{place}")]
    assert row["gain"] == pytest.approx(factor, rel=0.03)
    assert row["delay"] == pytest.approx(LATE, abs=3e-5)
    assert "late by 1.2 ms" in result.output
    assert tuned["gap"]["sensors"]["tuned"]["excess"] < 1.1
    assert "its tolerance of 2 % is in the intervals" in result.output


def test_a_drive_that_is_late_beyond_its_tolerance_is_named(tmp_path):
    write_encoder_campaign(
        tmp_path, gains={"drive": -3.1}, delays={"drive": LATE}, extra=UNKNOWN, lines=60
    )
    remarks = open_session(tmp_path, (10.0, 160.0)).campaign.remarks
    (late,) = [text for text in remarks if "seems to be late" in text]
    assert re.search(r"drive drive seems to be late by 0\.001[1-4] s, beyond its tolerance", late)
    target = tmp_path / "verdict.json"
    command = ["diagnose", str(tmp_path), "--json", str(target), "--jobs", "1"]
    result = RUNNER.invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    verdict = json.loads(target.read_text(encoding="utf-8"))
    cause = verdict["causes"][0]
    assert (cause["effect"], cause["location"]) == ("hammer_delay", "hammer:drive")
    assert cause["parameters"]["delay"] == pytest.approx(LATE, rel=0.05)
    (row,) = [each for each in verdict["channel_gains"] if each["dof"] is None]
    assert row["gain"] == pytest.approx(-3.1, rel=0.05)


def test_units_of_motions_and_signals_stand_side_by_side(tmp_path):
    """An encoder in counts and a drive in amperes beside accelerometers and a hammer in SI."""
    gains = {"encoder": -2.5e6, "drive": 3.1}
    write_encoder_campaign(tmp_path, gains=gains, extra=UNKNOWN, lines=60)
    plain = open_session(tmp_path, (10.0, 160.0)).campaign
    path = tmp_path / "campaign.toml"
    text = path.read_text(encoding="utf-8")
    assert "unit =" not in text
    text = text.replace("averages", 'unit = "m/s^2/N, rad/s^2/N, count/A"\naverages', 1)
    joint = '[sensor."joint:frame_tx"]'
    path.write_text(f'{text}{joint}\ngain = "unknown"\n', encoding="utf-8")
    stated = open_session(tmp_path, (10.0, 160.0)).campaign
    rows = [k for k, channel in enumerate(CHANNELS) if channel != "joint:frame_tx"]
    for first, second in zip(plain.tests, stated.tests, strict=True):
        values, others = (each.estimate.frf.values[:, rows] for each in (first, second))
        np.testing.assert_allclose(values, others, rtol=0.01)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        open_session(tmp_path, (10.0, 160.0))
    assert f'add {joint} with gain = "unknown"' in str(refused.value)


def test_an_encoder_in_metres_beside_accelerometers_in_g_stays_in_metres(tmp_path):
    write_encoder_campaign(tmp_path, lines=60)
    plain = open_session(tmp_path, (10.0, 160.0)).campaign
    path = tmp_path / "campaign.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("averages", 'unit = "g/N"\naverages', 1), encoding="utf-8")
    chosen = [CHANNELS.index(name) for name in ("encoder", "acc2:+x")]
    with np.load(tmp_path / "test.npz") as file:
        arrays = dict(file)
    rows = [k for k, name in enumerate(CHANNELS) if name not in ("encoder", "carriage:+ry")]
    arrays["frf"][:, rows] /= 9.80665
    np.savez(tmp_path / "test.npz", **arrays)
    stated = open_session(tmp_path, (10.0, 160.0)).campaign
    for first, second in zip(plain.tests, stated.tests, strict=True):
        values, again = (each.estimate.frf.values[:, chosen] for each in (first, second))
        np.testing.assert_allclose(values, again, rtol=1e-9)
    assert any("no unit of encoder and rotations, which are read in SI" in text
               for text in stated.remarks)  # fmt: skip
