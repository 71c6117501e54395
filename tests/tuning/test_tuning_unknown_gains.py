"""Gains that a campaign calls unknown: estimated, fitted, stated with intervals."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from diagnosis import build_verdict, diagnose
from identification.words import InputError
from mbmodel import body_parts, sensor_parts, spring_parts
from mbw.command import app
from tests.helpers.torque_campaign import LABELS, OUTPUTS, write_torque_campaign
from tuning import open_session
from tuning import tune as tune_campaign

RUNNER = CliRunner()
BAND = (5.0, 165.0)
HAMMER = -1 / 4.1e3  # volts per newton, of a cable with exchanged poles
COUNTS = {"acc4:+tx": 2.1e4, "acc4:+ty": -1.9e4, "acc4:+tz": 2.2e4, "acc4:+rz": -3e-3}
SENSOR_BLOCK = '[sensor.acc4]\ngain = "unknown"\n'
HAMMER_BLOCK = '[hammer.default]\ngain = "unknown"\n'
DRIVE_BLOCK = '[hammer.drive]\ngain = "unknown"\n'
ALL_SENSORS = "".join(f'[sensor.acc{k}]\ngain = "unknown"\n' for k in range(1, 7))


def parts(machine):
    return (*spring_parts(machine), *body_parts(machine), *sensor_parts(machine, OUTPUTS))


def list_gains(session, tuned):
    names = [parameter.name for parameter in session.model.parameters]
    theta = dict(zip(names, tuned.model_fit.theta, strict=True))
    return {
        (gain.location, gain.direction): gain.value * theta[gain.parameter]
        for gain in session.campaign.unknown_gains.nominal
    }


def test_gains_of_channels_hammer_and_drive_are_found_with_their_signs(tmp_path):
    truth = write_torque_campaign(
        tmp_path / "case",
        parts,
        spread=0.4,
        extra=SENSOR_BLOCK + HAMMER_BLOCK + DRIVE_BLOCK,
        factors=COUNTS,
        drives={"drive": 0.013, **dict.fromkeys(LABELS[:4], HAMMER)},
    )
    session = open_session(tmp_path / "case", BAND)
    nominal = {
        (gain.location, gain.direction): gain.value
        for gain in session.campaign.unknown_gains.nominal
    }
    expected = {
        **{("sensor:acc4", label[-2:]): gain for label, gain in COUNTS.items()},
        ("hammer:default", None): HAMMER,
        ("hammer:drive", None): 0.013,
    }
    assert nominal.keys() == expected.keys()
    for key, gain in expected.items():
        assert nominal[key] / gain == pytest.approx(1.0, abs=0.3)
    tuned = tune_campaign(session)
    assert tuned.sensors.gap(tuned.sensors.tuned).excess < 1.1
    for key, gain in list_gains(session, tuned).items():
        assert gain == pytest.approx(expected[key], rel=0.02), key
    names = [parameter.name for parameter in session.model.parameters]
    stiffness = dict(zip(names, tuned.model_fit.theta, strict=True))
    for name in ("base_tx.stiffness", "head_rz.stiffness"):
        assert stiffness[name] == pytest.approx(truth[name], rel=0.02)


def test_two_hammers_have_gains_of_their_own_by_the_names_of_their_tests(tmp_path):
    case = tmp_path / "case"
    write_torque_campaign(case, parts, labels=LABELS[:4], drives={"3:+rz": 50.0})
    content = dict(np.load(case / "test.npz"))
    text = (case / "campaign.toml").read_text()
    for name, columns in (("first", slice(0, 3)), ("second", slice(3, 4))):
        rows = {key: content[key][:, :, columns] for key in ("frf", "coherence")}
        np.savez(case / f"{name}.npz", **rows, freq_hz=content["freq_hz"])
    block = text[text.index("[[test]]") :]
    together, forces = str(list(LABELS[:4])), str(list(LABELS[:3]))
    first = block.replace("test.npz", "first.npz").replace(together, forces)
    second = block.replace("test.npz", "second.npz").replace(together, "['3:+rz']")
    tail = 'hammer = "big"\n[hammer.big]\ngain = "unknown"\n'
    (case / "campaign.toml").write_text('model = "model.xml"\n' + first + second + tail)
    session = open_session(case, BAND)
    (gain,) = session.campaign.unknown_gains.nominal
    assert gain.location == "hammer:big"
    tuned = tune_campaign(session)
    assert list_gains(session, tuned)["hammer:big", None] == pytest.approx(50.0, rel=0.03)
    assert tuned.sensors.gap(tuned.sensors.tuned).excess < 1.1


def test_where_all_gains_are_unknown_only_products_are_stated(tmp_path):
    write_torque_campaign(
        tmp_path / "case",
        parts,
        extra=ALL_SENSORS + HAMMER_BLOCK + DRIVE_BLOCK,
        factors={str(dof): 10.0 + k for k, dof in enumerate(OUTPUTS)},
        drives={"drive": -0.5, **dict.fromkeys(LABELS[:4], 2.0)},
    )
    out = tmp_path / "out"
    outcome = RUNNER.invoke(
        app, ["tune", str(tmp_path / "case"), "--band", "5", "165", "--out", str(out)]
    )
    assert outcome.exit_code == 0, outcome.stderr
    assert "only the products of the gains of acc1, acc2" in outcome.stderr
    rows = json.loads((out / "tuned.json").read_text())["channel_gains"]
    by_key = {(row["location"], row["dof"]): row for row in rows}
    assert ("hammer:default", None) not in by_key  # set to 1, since only products are seen
    row = by_key["sensor:acc4", "tz"]
    assert row["is_product"]
    product = 2.0 * (10.0 + OUTPUTS.index(next(d for d in OUTPUTS if str(d) == "acc4:+tz")))
    assert row["interval"][0] < product < row["interval"][1]
    drive = by_key["hammer:drive", None]
    assert not drive["is_product"]
    assert drive["gain"] == pytest.approx(-0.25, rel=0.02)  # relative to the hammer


def test_an_effect_beside_unknown_gains_is_named_and_no_channel_is_blamed(tmp_path):
    write_torque_campaign(
        tmp_path / "case",
        parts,
        changed={"acc6.gain_rz": 1.3},
        extra=SENSOR_BLOCK + HAMMER_BLOCK,
        factors=COUNTS,
        drives=dict.fromkeys(LABELS[:4], HAMMER),
    )
    diagnosis = diagnose(open_session(tmp_path / "case", BAND))
    verdict = build_verdict(diagnosis)
    assert verdict.verdict == "explained"
    row = verdict.causes[0]
    assert (row.effect, row.location, row.dof) == ("sensor_gain", "sensor:acc6", "rz")
    assert {fault.location for fault in diagnosis.checks.faults} <= {"sensor:acc6"}
    found = {(gain.location, gain.dof): gain for gain in verdict.channel_gains}
    for label, gain in COUNTS.items():
        low, high = found["sensor:acc4", label[-2:]].interval
        assert low - 0.003 * abs(gain) < gain < high + 0.003 * abs(gain)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ('[hammer]\ngain = "unknown"\n', "or [hammer.default] for the tests that name none"),
        ('[hammer.big]\ngain = "unknown"\n', "no test has this hammer (there are default, drive)"),
        ('[sensor.acc4]\ngain = "unkown"\n', "sensor.acc4.gain"),
    ],
)
def test_wrong_statements_of_gains_are_refused(tmp_path, extra, words):
    write_torque_campaign(tmp_path / "case", parts, extra=extra, lines=16)
    outcome = RUNNER.invoke(app, ["tune", str(tmp_path / "case")])
    assert outcome.exit_code == 3
    assert words in outcome.stderr


def test_a_modal_model_says_what_an_unknown_gain_means(tmp_path):
    write_torque_campaign(
        tmp_path / "case", parts, extra=SENSOR_BLOCK + HAMMER_BLOCK, factors=COUNTS
    )
    outcome = RUNNER.invoke(
        app,
        ["identify", str(tmp_path / "case"), "--band", "5", "165", "--out", str(tmp_path / "out")],
    )
    assert outcome.exit_code == 0, outcome.stderr
    text = " ".join(outcome.stderr.split())
    assert "the gain of acc4 is unknown: its FRFs are divided by an estimate" in text
    assert "the gain of the force channel default is unknown" in text
    assert "acc4" not in text.partition("redundant")[2]


@pytest.mark.parametrize(
    ("unit", "extra", "words"),
    [
        ("m/s^2/count", "", 'add [hammer.default] with gain = "unknown"'),
        ("V/N", HAMMER_BLOCK, 'add [sensor.acc1] with gain = "unknown"'),
        ("m/s^2/count", HAMMER_BLOCK, None),
        ("V/N", ALL_SENSORS, None),
    ],
)
def test_signals_need_an_unknown_gain(tmp_path, unit, extra, words):
    write_torque_campaign(
        tmp_path / "case", parts, labels=LABELS[:3], extra=f'unit = "{unit}"\n{extra}', lines=40
    )
    if words is None:
        assert open_session(tmp_path / "case", BAND).campaign.unknown_gains.nominal
        return
    with pytest.raises(InputError) as caught:
        open_session(tmp_path / "case", BAND)
    assert words in str(caught.value)
