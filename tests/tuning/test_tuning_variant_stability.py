"""Control loops in models and poses of tests: an unstable one is told by name.

The loop has a notch between the carriage's resonances with and without ballast, so that its phase
leads at one and lags at the other. Poles and margins come from matrices written by hand.
"""

import json
import re

import numpy as np
import pytest
from encoder_campaign import (
    CHANNELS,
    REFERENCES,
    axis_frfs,
    write_encoder_campaign,
    write_loaded_axis,
)
from typer.testing import CliRunner

import mbworkbench as mb
from identification.words import InputError
from mbmodel import Evaluator, FrfRequest, parse_input, parse_output
from mbw.command import app
from tuning import open_session
from tuning.control_loops.stability import tuned_loop_remarks
from tuning.plant.variant_model import read_variant_model

RUNNER = CliRunner()
ADDED, SHIFT = 6.0, 0.12
LOADED, POSE = 'model = "loaded.xml"', f"pose = {{ carriage_tx = {SHIFT} }}"
OMEGA, GAIN = 2 * np.pi * 20.0, 4e3
ZERO, POLE = (OMEGA * np.exp(1j * np.arccos(-damping)) for damping in (0.02, 0.7))
LOOP = f"""
[loop.notch]
input = "drive"
output = "encoder"
delay = 1e-4
controller = {{ gain = {GAIN}, zeros = [[{ZERO.real}, {ZERO.imag}], [{ZERO.real}, {-ZERO.imag}]],
  poles = [[{POLE.real}, {POLE.imag}], [{POLE.real}, {-POLE.imag}]] }}
""".replace(",\n ", ",")
BUDGET = f"""band = [8.0, 160.0]
[error.x]
output = "acc2:+tx"
[disturbance.hit]
input = "hit1:+tz"
density = 1.0
unit = "N/sqrt(Hz)"
{LOOP}"""


def notch(s):
    """K(s) with its delay."""
    ratio = (s - ZERO) * (s - ZERO.conjugate()) / ((s - POLE) * (s - POLE.conjugate()))
    return GAIN * ratio * np.exp(-1e-4 * s)


def loop_gain(freq, **state):
    """L by hand."""
    column = axis_frfs(freq, {}, **state)[:, CHANNELS.index("encoder"), REFERENCES.index("drive")]
    return notch(2j * np.pi * freq) * column


def encirclements(**state):
    """Turns of 1 + L around the origin: the number of unstable poles, L having none."""
    freq = np.geomspace(1e-3, 1e4, 400_000)
    angle = np.unwrap(np.angle(1 + loop_gain(freq, **state)))
    return round(-2 * (angle[-1] - angle[0]) / (2 * np.pi))


def write_case(folder, extra=""):
    folder.mkdir(parents=True, exist_ok=True)
    write_loaded_axis(folder / "loaded.xml", ADDED)
    further = {LOADED: {"added_mass": ADDED}, POSE: {"shift": SHIFT}}
    write_encoder_campaign(folder, further=further, lines=60, extra=extra)
    (folder / "budget.toml").write_text(BUDGET, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A campaign that was measured with the loop open."""
    return write_case(tmp_path_factory.mktemp("variants") / "campaign")


@pytest.fixture(scope="module")
def tuned(campaign):
    out = campaign.parent / "tuned"
    result = RUNNER.invoke(app, ["tune", str(campaign), "--out", str(out), "--no-pictures"])
    assert result.exit_code == 0, result.output
    return out


def test_the_case_is_stable_but_for_the_ballast():
    assert encirclements() == 0
    assert encirclements(shift=SHIFT) == 0
    assert encirclements(added_mass=ADDED) == 2


def test_a_budget_names_the_unstable_variant_and_has_the_margins_of_the_others(campaign, tmp_path):
    target = tmp_path / "out.json"
    command = ["predict", str(campaign), "--budget", str(campaign / "budget.toml")]
    result = RUNNER.invoke(app, [*command, "--json", str(target), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    content = json.loads(target.read_text(encoding="utf-8"))["budget"]
    rows = {row["variant"]: row for row in content["margins"]["variants"]}
    assert set(rows) == {"loaded.xml", f"carriage_tx = {SHIFT:g}"}
    loaded, moved = rows["loaded.xml"], rows[f"carriage_tx = {SHIFT:g}"]
    assert not loaded["is_stable"]
    assert loaded["loops"] == []
    assert loaded["growing_pole"] == pytest.approx(18.0, abs=2.0)
    assert moved["is_stable"]
    by_hand = np.abs(1 + loop_gain(np.geomspace(1.0, 400.0, 200_000), shift=SHIFT)).min()
    assert moved["loops"][0]["modulus"] == pytest.approx(by_hand, rel=1e-5)
    itself = np.abs(1 + loop_gain(np.geomspace(1.0, 400.0, 200_000))).min()
    assert content["margins"]["loops"][0]["modulus"]["value"] == pytest.approx(itself, rel=1e-5)
    assert by_hand != pytest.approx(itself, rel=1e-3)
    sentence = r"The machine \(loaded\.xml\) with notch closed is unstable: the pole .* Hz grows"
    assert re.search(sentence, result.output)
    page = (tmp_path / "out" / "plant.html").read_text(encoding="utf-8")
    assert re.search(sentence, page)
    assert "Models and poses of the tests" in page


def test_a_tuned_machine_is_checked_in_each_variant_with_its_posterior(campaign, tuned):
    result = mb.error_budget(tuned, campaign / "budget.toml", campaign=campaign)
    loaded, moved = (result.variants[name] for name in ("loaded.xml", f"carriage_tx = {SHIFT:g}"))
    assert loaded.pole is not None
    assert (loaded.unstable_samples, loaded.samples) == (60, 60)
    assert (moved.pole, moved.unstable_samples) == (None, 0)
    command = ["predict", str(tuned), "--budget", str(campaign / "budget.toml"), "--no-pictures"]
    said = RUNNER.invoke(app, command)
    assert said.exit_code == 0, said.output
    assert "The machine (loaded.xml) with notch closed is unstable" in said.output


def test_variants_have_the_tuned_values_of_the_tuning(campaign, tuned):
    variants = read_variant_model(campaign, tuned)
    model = mb.read_model(tuned / "tuned.xml")
    freq = np.linspace(10.0, 150.0, 30)
    expected = model.frf("encoder", "drive", freq, "receptance").values
    machine = variants.model.machine
    request = FrfRequest(
        freq, (parse_output(machine, "encoder"),), (parse_input(machine, "drive"),), "receptance"
    )
    values = Evaluator(variants.model, request).at(variants.theta).values
    np.testing.assert_allclose(values, expected, rtol=1e-5)
    loaded = Evaluator(variants.model.in_variant("loaded.xml"), request).at(variants.theta)
    assert np.abs(loaded.values / expected - 1).max() > 0.1


def test_a_loop_of_the_test_that_is_unstable_in_a_variant_is_refused_by_its_name(tmp_path):
    write_case(tmp_path, LOOP)
    with pytest.raises(InputError, match=r"machine \(loaded\.xml\) with loop\.notch closed is"):
        open_session(tmp_path)


def test_a_loop_that_is_stated_as_right_is_a_remark_by_the_variants_name(tmp_path):
    write_case(tmp_path, f"{LOOP}as_stated = true\n")
    session = open_session(tmp_path)
    (remark,) = [text for text in session.campaign.remarks if "is unstable" in text]
    assert "(loaded.xml) with loop.notch closed" in remark
    (doubt,) = tuned_loop_remarks(session.model, session.model.drawn)
    assert doubt.startswith("the tuned machine (loaded.xml) with notch closed is unstable")


def test_a_plant_with_a_closed_loop_says_in_which_variant_it_is_unstable(tmp_path):
    write_case(tmp_path, f"{LOOP}as_stated = true\n")
    command = ["predict", str(tmp_path), "--modes", "--no-pictures", "--json"]
    for closed, count in ((["--closed", "notch"], 1), ([], 0)):
        target = tmp_path / "modes.json"
        result = RUNNER.invoke(app, [*command, str(target), *closed])
        assert result.exit_code == 0, result.output
        remarks = json.loads(target.read_text(encoding="utf-8"))["remarks"]
        unstable = [text for text in remarks if "is unstable" in text]
        assert len(unstable) == count
        assert all("The machine (loaded.xml) with notch closed" in text for text in unstable)
