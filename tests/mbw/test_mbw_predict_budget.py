"""``mbw predict --budget``: terminal, JSON, page, and the machine beside."""

import json
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, browse, data_of, unpacked
from budget_case import TWO, VALUES, write_tuned_case

import mbworkbench as mb
from mbmodel import load_machine, machine_model
from tests.helpers.command import invoke as run
from tuning import read_posterior
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.plant_budget import rms_interval
from tuning.plant.error_budget.read_definition import read_definition

ASSETS = Path(__file__).resolve().parents[2] / "assets"
PROBE = """<script>
setTimeout(() => {
  const texts = {plots: ["spectrum", "sources", "modes-of-error", "joints", "touches", "bode", "poles"].filter(name => byId(name).data && byId(name).data.length),
    spectrum: byId("spectrum").data.filter(t => t.showlegend !== false).map(t => t.name),
    bode: byId("bode").data.filter(t => t.showlegend !== false && t.name).map(t => t.name), faults: FAULTS};
  byId("choice").querySelectorAll("button")[1].click();
  const select = document.querySelector("#curves select");
  select.value = String(select.options.length - 1); select.onchange();
  texts.title = byId("bode").layout.title.text;
  texts.error = byId("spectrum").layout.yaxis.title.text;
  document.body.append(element("pre", JSON.stringify(texts), {id: "found"}));
}, 2500);
</script>"""  # noqa: E501


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A tuned machine with its posterior, its nominal one, and a budget with a loop."""
    place = tmp_path_factory.mktemp("plant")
    write_tuned_case(place)
    tuned = place / "x-tuned"
    result = run(
        "predict", tuned / "tuned.xml", "--budget", place / "budget.toml",
        "--out", place / "out", "--json", place / "out.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    (place / "stdout.txt").write_text(result.stdout, encoding="utf-8")
    return place


def test_a_tuned_machine_has_intervals_and_stands_beside_the_nominal_one(folder):
    row = json.loads((folder / "out.json").read_text())["budget"]
    assert row["before"].endswith("two.xml")
    assert row["loops"] == ["axis"]
    for error in row["errors"]:
        assert error["low"] < error["rms"] < error["high"]
        assert error["before"] != pytest.approx(error["rms"], rel=1e-3)
        assert sum(share["share"] for share in error["sources"] + error["cross_terms"]) == (
            pytest.approx(1.0)
        )
        assert error["cumulative"][0] == pytest.approx(error["rms"])
        assert sorted(error["cumulative"], reverse=True) == error["cumulative"]
    tuned = folder / "x-tuned"
    model = machine_model(load_machine(tuned / "tuned.xml"))
    posterior = read_posterior(tuned).on(model)
    definition = read_definition(folder / "budget.toml", model.machine)
    interval = rms_interval(error_budget(model, model.drawn, definition), posterior)
    assert [error["deviation"] for error in row["errors"]] == pytest.approx(interval.deviation)
    assert (interval.by_model_error > 1e-4).all()
    assert {touch["parameter"] for touch in row["errors"][0]["touches"]} == {
        "base_tx.stiffness", "base_tx.damping", "head_tx.stiffness", "head_tx.damping"
    }  # fmt: skip


LIMITED = """
band = [1, 100]
[error.y]
output = "acc2:+tx"
[noise.n]
loop = "a"
density = 1e-9
unit = "m/sqrt(Hz)"
[loop.a]
input = "acc1:+tx"
output = "acc2:+tx"
controller = { zeros = [-30.0], poles = [-600.0], gain = 2e5 }
"""


def test_the_json_has_what_limits_each_loop(folder):
    (folder / "limited.toml").write_text(LIMITED)
    files = "--budget", folder / "limited.toml", "--json", folder / "limited.json"
    assert run("predict", folder / "two.xml", *files, "--no-pictures").exit_code == 0
    (row,) = json.loads((folder / "limited.json").read_text())["budget"]["limits"]
    (loop,) = mb.margins(folder / "two.xml", folder / "limited.toml").loops
    assert (row["loop"], row["modulus"]) == ("a", 0.5)
    assert (row["gain"], row["crossover"]) == pytest.approx((loop.gain, loop.crossover_hz))
    assert len(row["modes"]) == len(loop.modes) > 0
    for stated, mode in zip(row["modes"], loop.modes, strict=True):
        values = stated["frequency"], stated["damping"], stated["gain"], stated["at"]
        assert values == pytest.approx((mode.freq_hz, mode.damping, mode.gain, mode.at_hz))
        assert stated["changes"] == pytest.approx(mode.changes)
        assert stated["bodies"] == pytest.approx(mode.bodies)
        assert (stated["notch"] is None) == (stated["notch_phase"] is None) == (mode.notch is None)
    assert row["modes"][0]["notch_crossover"] == pytest.approx(loop.modes[0].notch_crossover_hz)


def test_the_json_has_each_pole_of_the_closed_loops_and_the_page_those_that_oscillate(folder):
    # det(Z + K) = 0 with the loop, by hand: one real pole each of the controller.
    rows = json.loads((folder / "out.json").read_text())["budget"]["poles"]
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    mass, stiffness = np.diag([m1, m2]), np.array([[k1 + k2, -k2], [-k2, k2]])
    damping, pull = np.array([[c1 + c2, -c2], [-c2, c2]]), np.array([[1.0, -1.0], [-1.0, 1.0]])
    for row in rows:
        s = row["real"] + 1j * row["imaginary"]
        gain = 2 * 3e5 * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700)) * np.exp(-3e-4 * s)
        dynamic = s**2 * mass + s * damping + stiffness
        closed = np.linalg.det(dynamic + gain * pull) / np.linalg.det(dynamic + 2 * gain * pull)
        assert abs(closed) < 1e-4
        assert row["frequency"] == pytest.approx(abs(s) / (2 * np.pi))
        assert row["damping"] == pytest.approx(-s.real / abs(s))
    real = [row for row in rows if row["imaginary"] == 0]
    assert len(real) == 2
    assert [row["damping"] for row in real] == [1, 1]
    data = data_of((folder / "out" / "plant.html").read_text("utf-8"))
    assert len(data["poles"]) == len(rows) - 2


def test_the_terminal_states_the_error_with_its_interval_and_shares(folder):
    lines = (folder / "stdout.txt").read_text().splitlines()
    assert lines[0] == "error budget, 2 to 45 Hz, loops closed: axis:"
    assert lines[1].startswith("  top = acc2:+tx - acc1:+tx: ")
    assert " nm rms (95 %: " in lines[1]
    assert "; before " in lines[1]
    assert any(line.startswith("    cross terms: floor and ripple ") for line in lines)
    assert any(line.startswith("    10 % more of: ") for line in lines)


def test_the_page_holds_the_numbers_of_the_json(folder):
    row = json.loads((folder / "out.json").read_text())["budget"]["errors"][0]
    data = data_of((folder / "out" / "plant.html").read_text("utf-8"))
    top = data["errors"][0]
    assert unpacked(top["cumulative"]["values"])[0] == pytest.approx(1e9 * row["rms"], rel=1e-5)
    freq = unpacked(top["density"]["freq"]).astype(float)
    total = unpacked(top["density"]["total"]).astype(float)
    rms = np.sqrt(np.trapezoid(total**2, freq))
    assert rms == pytest.approx(1e9 * row["rms"], rel=0.02)
    assert data["curves"]["ports"][-1][0].startswith("plant of axis")
    assert data["samples"]


def test_gain_and_lag_of_a_drive_and_the_band_of_the_test_are_remarked(tmp_path):
    write_tuned_case(tmp_path)
    tuned, out = tmp_path / "x-tuned", tmp_path / "out.json"
    row = {"dof": None, "is_product": False, "interval": [0.36, 0.38], "gain": 0.37}
    rows = [
        {**row, "location": "hammer:drive", "delay": 1.2e-3},
        {**row, "location": "hammer:default", "delay": 2e-3},  # of a hammer, which is no drive
        {**row, "location": "sensor:encoder", "dof": "", "delay": 1e-7},
    ]
    text = json.dumps({"band": [5.0, 40.0], "channel_gains": rows})
    (tuned / "tuned.json").write_text(text, encoding="utf-8")
    (tuned / ".mbw.json").unlink()
    ports = ("--input", "drive", "--output", "acc2:+tx", "--bands", "--band", 6, 39)
    result = run(
        "predict", tuned, "--budget", tmp_path / "budget.toml", *ports, "--json", out,
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    lag = (
        "By tuned.json, drive has the gain 0.37 and is 1.2 ms late, which the model and this "
        "result do not hold: multiply its controller in budget.toml by 0.37, add delay = 0.0012 "
        "to its loop in budget.toml, and for a state space give --input-delay drive=0.0012."
    )
    answer = json.loads(out.read_text())
    band = "The test covered 5 to 40 Hz: outside that band no interval bounds the modes that the"
    assert answer["remarks"] == [lag]
    assert [text.startswith(band) for text in answer["budget"]["remarks"]] == [True]
    assert answer["bands"]["remark"] == ""
    assert lag in result.stderr
    assert "bands: the test covered" not in result.stderr
    page = (tmp_path / "out" / "plant.html").read_text("utf-8")
    assert lag in page
    assert band in page
    wide = run("predict", tuned, *ports[:-1], 60, "--json", out, "--out", tmp_path / "wide")
    assert wide.exit_code == 0, wide.stderr
    assert band[1:] in json.loads(out.read_text())["bands"]["remark"]
    assert band[1:] in wide.stderr
    plant = mb.read_plant(tuned, "acc2:+tx", "drive", [6.0, 60.0])
    assert [text[:13] for text in plant.remarks] == ["by tuned.json", "the test cove"]
    assert plant.remarks[0] in repr(plant)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_the_page_draws_in_a_browser(folder):
    found = browse((folder / "out" / "plant.html").read_text("utf-8"), folder, probe=PROBE)
    assert found["faults"] == []
    assert len(found["plots"]) == 7
    assert found["spectrum"][:2] == ["two", "as drawn (two.xml)"]
    assert found["bode"] == ["95 % interval", "as drawn (two.xml)", "two"]
    assert found["title"].startswith("plant of axis")
    assert found["error"] == "rms above / um"


def test_what_a_diagnosis_found_is_stated_in_the_unit_of_the_error(folder):
    diagnosed = folder / "x-diagnosed"
    diagnosed.mkdir()
    text = TWO.format(**{**VALUES, "k2": 5e4})
    (diagnosed / "augmented.xml").write_text(text, encoding="utf-8")
    steps = {name: {"error": 1.0, "excess": 9.0} for name in ("as_drawn", "retuned", "after")}
    cause = {
        "effect": "parallel_path", "location": "pair:base-head", "dof": "tx", "probability": 0.97,
        "parameters": {}, "interval": {}, "excess_after": 1.0,
    }  # fmt: skip
    verdict = {
        "verdict": "explained", "probability": {"none": 0.0, "unexplained": 0.0, "several": 0.0},
        "gap": {**steps, "noise": 0.1, "closed": 0.9, "interval": {}}, "where": [],
        "causes": [cause, {**cause, "effect": "appendage", "probability": 0.02}],
        "twins": [["parallel_path@pair:base-head", "joint_coupling@joint:head"]],
        "not_testable": [], "next_experiment": None,
    }  # fmt: skip
    (diagnosed / "verdict.json").write_text(json.dumps(verdict), encoding="utf-8")
    result = run(
        "predict", diagnosed / "augmented.xml", "--budget", folder / "budget.toml",
        "--before", folder / "x-tuned", "--out", folder / "with_cause",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    rivals = (
        "In place of parallel_path@pair:base-head there may be appendage@pair:base-head (2 %), "
        "joint_coupling@joint:head (confounded): their plants are not computed"
    )
    assert rivals in result.stdout
    assert rivals in (folder / "with_cause" / "plant.html").read_text("utf-8")
    causes = [line for line in result.stdout.splitlines() if "parallel_path" in line]
    assert causes[0].startswith("top: parallel_path at pair:base-head costs ")
    assert causes[0].endswith(" nm")


def test_an_unstable_loop_ends_with_exit_code_3_and_one_sentence(folder):
    text = (folder / "budget.toml").read_text().replace("gain = 300000.0", "gain = 8e7")
    (folder / "hot.toml").write_text(text, encoding="utf-8")
    result = run("predict", folder / "two.xml", "--budget", folder / "hot.toml", "--no-pictures")
    assert result.exit_code == 3
    assert "closed loop is unstable: the pole" in result.stderr
    assert "change the gain of axis" in result.stderr


def test_a_machine_beside_without_a_budget_is_a_usage_error(folder):
    result = run("predict", folder / "two.xml", "--before", folder / "two.xml")
    assert result.exit_code == 2


def test_the_station_has_a_budget_as_its_readme_shows(tmp_path):
    station = ASSETS / "microstation"
    result = run(
        "predict", station / "station_identified.xml", "--budget", station / "budget.toml",
        "--before", station / "station.xml", "--no-pictures", "--json", tmp_path / "b.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    row = json.loads((tmp_path / "b.json").read_text())["budget"]
    assert [error["name"] for error in row["errors"]] == ["x", "z", "tilt"]
    assert row["errors"][0]["modes"][0]["frequency"] == pytest.approx(11.9, abs=0.1)


def test_struts_have_gain_damping_and_frames_on_terminal_page_and_json(tmp_path):
    station = ASSETS / "microstation"
    result = run(
        "predict", station / "station_legs.xml", "--budget", station / "budget.toml",
        "--struts", "leg*", "--out", tmp_path / "out", "--json", tmp_path / "s.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    row = json.loads((tmp_path / "s.json").read_text())["struts"]
    assert row["sets"][0]["struts"] == [f"leg{k}" for k in range(1, 7)]
    assert row["frames"]["body"] == "hexapod"
    assert np.shape(row["frames"]["jacobian_mass"]) == (6, 6)
    assert "integral force feedback" in result.stdout
    data = data_of((tmp_path / "out" / "plant.html").read_text("utf-8"))["struts"]
    first = data["loci"][0]
    assert np.hypot(*first["best"]) == pytest.approx(row["sets"][0]["frequency"])


def test_struts_need_no_budget_and_other_names_are_refused(folder):
    result = run("predict", folder / "x-tuned", "--struts", "head_tx", "--no-pictures")
    assert result.exit_code == 0, result.stderr
    assert "no frames: a frame needs six struts" in result.stdout
    assert "(95 %: " in result.stdout  # the tuned machine has a posterior
    refused = run("predict", folder / "two.xml", "--struts", "arm", "--no-pictures")
    assert refused.exit_code == 2
    assert "choose of base_tx, head_tx" in refused.stderr


def test_a_machine_that_is_not_the_fitted_one_has_no_interval(folder):
    result = run(
        "predict", folder / "x-tuned", "--budget", folder / "budget.toml", "--no-pictures",
        "--loss-factor", "head_tx=0.05",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert "95 %" not in result.stdout
    stiff = run("predict", folder / "x-tuned", "--budget", folder / "budget.toml", "--no-pictures")
    assert "95 %" in stiff.stdout
    first = [
        line.split("rms")[0]
        for line in (result.stdout.splitlines()[1], stiff.stdout.splitlines()[1])
    ]
    assert first[0] != first[1]  # the loss acts
