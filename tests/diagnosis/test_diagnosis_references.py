"""Torques, motors and rotation channels: tuned to the truth, and the verdict names the effect."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from diagnosis import build_verdict, diagnose
from identification.words import Dof
from mbmodel import (
    Evaluator,
    FrfRequest,
    HammerGainPart,
    Model,
    body_parts,
    hammer_parts,
    load_machine,
    sensor_parts,
    spring_parts,
)
from mbw.command import app
from tests.helpers.torque_campaign import LABELS, OUTPUTS, REFERENCES, write_torque_campaign
from tuning import open_session
from tuning import tune as tune_campaign

RUNNER = CliRunner()


def parts(machine):
    return (
        *spring_parts(machine),
        *body_parts(machine),
        *sensor_parts(machine, OUTPUTS),
        *hammer_parts(machine, REFERENCES[:1]),
    )


@pytest.mark.parametrize("labels", [LABELS, ("3:+rz",), ("drive",)], ids=["all", "torque", "motor"])
def test_a_fit_finds_the_springs_and_every_tolerance_keeps_its_place(tmp_path, labels):
    truth = write_torque_campaign(tmp_path / "case", parts, labels=labels)
    session = open_session(tmp_path / "case", (5.0, 165.0))
    tuned = tune_campaign(session)
    gap = tuned.sensors.gap(tuned.sensors.tuned)
    assert 0.9 < gap.excess < 1.1
    assert tuned.confidence is not None
    theta = tuned.confidence.parametrisation.theta(tuned.confidence.x)
    value = dict(zip((p.name for p in session.model.parameters), theta, strict=True))
    if labels is LABELS:
        for name in ("base_tx.stiffness", "head_rz.stiffness", "head_rz.damping"):
            assert value[name] == pytest.approx(truth[name], rel=0.08)
    assert "acc6.gain_rz" in value
    channels = {part.location for part in session.model.parts if isinstance(part, HammerGainPart)}
    assert channels == {f"hammer:{test.condition.instrument}" for test in session.campaign.tests}
    forces = {p.name.split(".")[0] for p in session.model.parameters if "(acc" in p.name}
    assert forces == {
        f"hammer(acc3:t{label[-1]})" for label in labels if ":" in label and "r" not in label
    }


@pytest.mark.parametrize(
    ("changed", "labels", "cause"),
    [
        ({"acc4.gain_rz": 1.25}, LABELS, ("sensor_gain", "sensor:acc4", "rz")),
        ({"acc6.gain_rz": -1.0}, ("3:+rz", "3:+x"), ("sensor_polarity", "sensor:acc6", "rz")),
        ({"head.mass": 41.0}, LABELS, ("mass_error", "body:head", None)),
        (
            {"hammer(acc3:tx).rotation_z": 0.2},
            LABELS,
            ("hammer_misalignment", "hammer:acc3", "tx"),
        ),
    ],
)
def test_the_verdict_names_the_one_effect(tmp_path, changed, labels, cause):
    write_torque_campaign(tmp_path / "case", parts, changed=changed, labels=labels, lines=100)
    result = diagnose(open_session(tmp_path / "case", (5.0, 165.0)))
    verdict = build_verdict(result)
    assert verdict.verdict == "explained"
    row = verdict.causes[0]
    assert (row.effect, row.location, row.dof) == cause
    for name, value in changed.items():
        if name.endswith("gain_rz") and value > 0:
            assert row.parameters["gain"] == pytest.approx(value, rel=0.03)


def test_every_verb_reads_torques_and_writes_their_units(tmp_path):
    write_torque_campaign(tmp_path / "case", parts, lines=80)
    case = str(tmp_path / "case")
    for verb, units in (
        (
            "identify",
            ('"motion": ["', "rad/s\\u00b2", '"force": ["N", "N", "N", "(N m)", "control"]'),
        ),
        ("tune", ("rad/s\\u00b2/(N m)", "m/s\\u00b2/control")),
        ("diagnose", ("rad/s\\u00b2/(N m)", "m/s\\u00b2/control")),
    ):
        out = tmp_path / verb
        outcome = RUNNER.invoke(app, [verb, case, "--band", "5", "165", "--out", str(out)])
        assert outcome.exit_code == 0, outcome.stderr
        if verb == "tune":
            assert RUNNER.invoke(app, ["report", str(out)]).exit_code == 0
        page = "".join(file.read_text(encoding="utf-8") for file in out.glob("*.html"))
        for unit in units:
            assert unit in page or unit.encode().decode("unicode_escape") in page, (verb, unit)


def test_a_noisy_campaign_has_no_relative_error_and_says_so(tmp_path):
    write_torque_campaign(tmp_path / "case", parts, noise=0.6, lines=80)
    case = str(tmp_path / "case")
    for verb, name in (("tune", "tuned.json"), ("diagnose", "verdict.json")):
        out = tmp_path / verb
        outcome = RUNNER.invoke(app, [verb, case, "--band", "5", "165", "--out", str(out)])
        assert outcome.exit_code == 0, outcome.stderr
        assert "exceeds 30 % of its motion, so no relative error is stated" in outcome.stderr
        gap = json.loads((out / name).read_text(encoding="utf-8"))["gap"]
        gap = gap.get("sensors", gap)
        assert gap["as_drawn"]["error"] is None
        assert gap["as_drawn"]["excess"] > 0
        assert RUNNER.invoke(app, ["report", str(out)]).exit_code == 0


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("motor9", "'motor9' is no motor of the model: choose one of drive"),
        ("acc3", "'acc3' names a point or body without a direction: write acc3:+x"),
        ("3", "'3' is not a label"),
    ],
)
def test_a_reference_that_is_no_motor_is_refused(tmp_path, wrong, words):
    write_torque_campaign(tmp_path / "case", parts, labels=("3:+x",))
    toml = tmp_path / "case" / "campaign.toml"
    toml.write_text(toml.read_text().replace("'3:+x']", f"'{wrong}']"))
    outcome = RUNNER.invoke(app, ["tune", str(tmp_path / "case")])
    assert outcome.exit_code == 3
    assert words in outcome.stderr


def test_gains_of_rotation_channels_have_exact_slopes(tmp_path):
    write_torque_campaign(tmp_path / "case", parts, labels=("3:+x",), lines=8)
    machine = load_machine(tmp_path / "case" / "model.xml")
    model = Model(machine, sensor_parts(machine, OUTPUTS))
    random = np.random.default_rng(1)
    theta = model.drawn + random.normal(0, 0.05, len(model.drawn))
    request = FrfRequest(np.linspace(20.0, 120.0, 6), OUTPUTS, (Dof("acc3", "+rz"), *REFERENCES))
    at = Evaluator(model, request, direct=True).at(theta)
    columns = at.columns()
    weights = random.normal(size=(2, *at.values.shape))
    cotangent = weights[0] + 1j * weights[1]
    for k in range(len(theta)):
        step = np.where(np.arange(len(theta)) == k, 1e-6, 0.0)
        up, down = (
            Evaluator(model, request, direct=True).at(theta + s * step).values for s in (1, -1)
        )
        np.testing.assert_allclose(columns[..., k], (up - down) / 2e-6, atol=1e-6 * abs(up).max())
    slope = np.einsum("fio,fiop->p", cotangent.conj(), columns).real
    np.testing.assert_allclose(
        at.gradient(cotangent), slope, rtol=1e-8, atol=1e-9 * abs(slope).max()
    )
