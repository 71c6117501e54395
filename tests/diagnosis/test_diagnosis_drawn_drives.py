"""Machines that ``truth/`` draws, tested from motors to encoders with unknown gains."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from mbw.command import app
from tests.helpers.drawn_drives import write_drive_campaign
from truth import Cause, Plan, Protocol, Wanted
from truth.machine.random_tree import draw_tree

RUNNER = CliRunner()
RATIO = 4.0  # of the gap of a re-tuned machine over the noise of its test


def drawn_campaign(folder, seed, effect=None):
    nominal = draw_tree(seed, 2)
    protocol = Protocol((nominal.first_aim(),), lines=201, resolution_hz=1.0)
    cause = Cause((Wanted(effect, ratio=RATIO),)) if effect else Cause()
    return write_drive_campaign(nominal, Plan(seed, cause=cause, protocol=protocol), folder)


def run(*arguments):
    result = RUNNER.invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result


def fitted_gains(rows):
    """Return gain and interval by the name of motor or encoder."""
    return {row["location"].partition(":")[2]: (row["gain"], row["interval"]) for row in rows}


def test_gains_and_springs_of_a_drawn_machine_are_found_from_motors_to_encoders(tmp_path):
    subject, gains = drawn_campaign(tmp_path / "case", 1)
    run("tune", tmp_path / "case", "--out", tmp_path / "tuned", "--no-pictures", "-q")
    tuned = json.loads((tmp_path / "tuned" / "tuned.json").read_text(encoding="utf-8"))
    assert tuned["gap"]["sensors"]["tuned"]["excess"] < 1.1
    for name, (gain, (low, high)) in fitted_gains(tuned["channel_gains"]).items():
        assert gain == pytest.approx(gains[name], rel=0.03), name
        assert low < gains[name] < high, name
    true = {
        f"{joint.name}.stiffness": joint.stiffness
        for stage in subject.machine.station.stages
        for joint in stage.joints
    }
    rows = [row for row in tuned["parameters"] if row["name"] in true]
    assert len(rows) == len(true)
    inside = [row["low"] < true[row["name"]] < row["high"] for row in rows]
    assert np.mean(inside) > 0.8


@pytest.mark.parametrize("effect", ["joint_coupling", "appendage", "flexible_body"])
def test_the_fault_of_a_drawn_machine_is_named_from_motors_to_encoders(tmp_path, effect):
    subject, gains = drawn_campaign(tmp_path / "case", 2, effect)
    target = tmp_path / "verdict.json"
    command = ["diagnose", tmp_path / "case", "--json", target, "--out", tmp_path / "out"]
    run(*command, "--jobs", 1, "-q")
    verdict = json.loads(target.read_text(encoding="utf-8"))
    (drawn,) = subject.draws.drawn
    assert verdict["verdict"] == "explained"
    cause = verdict["causes"][0]
    stage = drawn.effect.stage if effect == "joint_coupling" else drawn.effect.body
    place = f"joint:{stage}" if effect == "joint_coupling" else f"body:{stage}"
    assert (cause["effect"], cause["location"]) == (effect, place)
    assert cause["probability"] > 0.9
    if effect != "joint_coupling":
        close = {"appendage": 0.01, "flexible_body": 0.05}[effect]
        assert cause["parameters"]["frequency"] == pytest.approx(drawn.effect.frequency, rel=close)
    assert ("flexible_body" in verdict["not_testable"]) is False
    for name, (gain, _) in fitted_gains(verdict["channel_gains"]).items():
        assert gain == pytest.approx(gains[name], rel=0.03), name
