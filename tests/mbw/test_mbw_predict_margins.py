"""Stability margins of ``mbw predict --budget``: JSON, terminal and page."""

import json

import control
import numpy as np
import pytest
import scipy.io
from browser import CHROMIUM, browse, data_of, unpacked
from budget_case import SECOND_LOOP, write_tuned_case

import mbworkbench as mb
from tests.helpers.command import invoke as run

PROBE = """<script>
setTimeout(() => {
  const names = id => byId(id).data.filter(t => t.showlegend !== false && t.name).map(t => t.name);
  const texts = {bode: names("loop-gain"), nyquist: names("nyquist"), sensitivity: names("sensitivity"), faults: FAULTS,
    step: byId("reference-step").data.length,
    marks: byId("loop-gain").data.filter(t => t.text).map(t => t.text[1].trim())};
  byId("loop-choice").querySelectorAll("button")[1].click();
  texts.none = byId("reference-step").textContent;
  texts.title = byId("loop-gain").layout.title.text;
  document.body.append(element("pre", JSON.stringify(texts), {id: "found"}));
}, 2500);
</script>"""  # noqa: E501


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A tuned machine with two loops, predicted."""
    place = tmp_path_factory.mktemp("margins")
    write_tuned_case(place, SECOND_LOOP)
    result = run(
        "predict", place / "x-tuned", "--budget", place / "budget.toml",
        "--out", place / "out", "--json", place / "out.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    (place / "stdout.txt").write_text(result.stdout, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def row(folder):
    return json.loads((folder / "out.json").read_text())["budget"]["margins"]


def test_the_json_has_each_margin_with_its_interval_and_worst_machine(folder, row):
    margins = mb.error_budget(folder / "x-tuned", folder / "budget.toml").margins
    assert row["machines"] == 60
    assert [loop["loop"] for loop in row["loops"]] == ["axis", "base"]
    axis = row["loops"][0]
    for key in ("crossover", "gain", "phase", "delay", "modulus"):
        values = [getattr(each.loops[0], key).value for each in margins.samples]
        shown = axis[key]
        assert shown["value"] == pytest.approx(getattr(margins.nominal.loops[0], key).value)
        assert shown["low"] <= shown["value"] <= shown["high"]
        assert np.mean([shown["low"] <= value <= shown["high"] for value in values]) >= 0.95
        assert shown["worst"] == pytest.approx(min(values, key=abs))
    assert axis["gain_reduction"]["value"] is None
    assert axis["sensitivity_peak"] == pytest.approx(1 / axis["modulus"]["value"])
    crossovers = [each["frequency"] for each in axis["gain_crossovers"]]
    assert axis["phase"]["frequency"] in crossovers
    worst = margins.samples[axis["worst_machine"]].loops[0].modulus.value
    assert worst == pytest.approx(axis["modulus"]["worst"])
    step, shown = margins.steps[0], axis["step"]
    assert shown["overshoot"] == pytest.approx(max(0.0, step.response.max() / step.final - 1))
    assert shown["rise_time"] == pytest.approx(step.rise_time_s)
    assert shown["settling_time"] == pytest.approx(step.settling_time_s)
    assert row["loops"][1]["step"] is None
    both = row["all_loops"]["modulus"]
    assert both["value"] <= min(loop["modulus"]["value"] for loop in row["loops"]) + 1e-9
    tests = [*axis["robust"], *row["all_loops"]["robust"]]
    assert [test["weight"] for test in tests] == ["model-error floor"] * 2
    assert all(test["holds"] == (test["peak"] < 1) for test in tests)


def test_the_machine_beside_has_its_margins_too(folder, row):
    nominal = mb.error_budget(folder / "two.xml", folder / "budget.toml").margins.nominal
    shown = row["loops"][0]
    for key in ("crossover", "gain", "phase", "delay", "modulus"):
        value = getattr(nominal.loops[0], key).value
        assert shown[key]["before"] == pytest.approx(value, rel=1e-6)
        assert value != pytest.approx(shown[key]["value"], rel=1e-4)
    assert row["all_loops"]["modulus"]["before"] == pytest.approx(nominal.modulus.value, rel=1e-6)
    data = data_of((folder / "out" / "plant.html").read_text("utf-8"))["margins"]["loops"][0]
    before = unpacked(data["before"]["values"], "<c8")
    assert np.abs(1 + before).min() == pytest.approx(shown["modulus"]["before"], rel=0.01)


def test_the_terminal_states_margins_of_each_loop_and_of_all(folder, row):
    text = (folder / "stdout.txt").read_text()
    assert "stability margins, over 60 machines of the posterior and the model-error floor:" in text
    phase = row["loops"][0]["phase"]
    assert (
        f"phase {phase['value']:.3g}° at {phase['frequency']:.4g} Hz (95 %: {phase['low']:.3g} to "
        f"{phase['high']:.3g}°; worst {phase['worst']:.3g}°; before {phase['before']:.3g}°)"
    ) in text
    decibels = 20 * np.log10(row["loops"][0]["gain"]["value"])
    assert f"gain {decibels:.3g} dB at" in text
    assert "no limit: gain reduction" in text
    assert "all loops at once:" in text
    assert "step of the reference: overshoot" in text
    assert "robustly stable: |W T| is at most" in text


def test_the_page_holds_the_loop_gain_of_the_json(folder, row):
    page = (folder / "out" / "plant.html").read_text("utf-8")
    loops = data_of(page)["margins"]["loops"]
    for shown, loop in zip(loops, row["loops"], strict=True):
        assert shown["name"] == loop["loop"]
        gain = unpacked(shown["values"], "<c8")
        distance = np.abs(1 + gain).min()
        assert distance == pytest.approx(loop["modulus"]["value"], rel=0.01)
        assert len(shown["samples"]) >= 19
        worst = unpacked(shown["worst"]["values"], "<c8")
        assert np.abs(1 + worst).min() == pytest.approx(loop["modulus"]["worst"], rel=0.01)
    assert page.count("<th>axis</th>") == 1
    assert "all loops at once" in page


@pytest.mark.parametrize("name", ["margins.npz", "margins.mat"])
def test_python_control_has_the_same_margins_from_the_files_alone(folder, row, name):
    path = folder / "out" / name
    file = scipy.io.loadmat(path, squeeze_me=True) if path.suffix == ".mat" else np.load(path)
    assert list(file["loops"]) == ["axis", "base"]
    assert list(file["outputs"]) == ["acc2:+tx - acc1:+tx", "acc1:+tx"]
    assert list(file["output_units"]) == ["m", "m/s"]
    assert file["input_units"][1] == "N"
    for number, loop in enumerate(row["loops"]):
        data = control.frd(file["loop_gain"][:, number], 2 * np.pi * file["freq_hz"])
        _, phases, distances, *_ = control.stability_margins(data, returnall=True)
        assert distances.min() == pytest.approx(loop["modulus"]["value"], rel=2e-3)
        if loop["phase"]["value"] is not None:
            assert min(phases, key=abs) == pytest.approx(loop["phase"]["value"], rel=0.01)
        assert file["modulus"].shape == (60, 2)
        assert file["modulus"][:, number].min() == pytest.approx(loop["modulus"]["worst"])
    whole = np.linalg.inv(np.eye(2) + file["all_loops_gain"])
    assert 1 / np.abs(whole[:, 0, 0]).max() == pytest.approx(
        row["loops"][0]["modulus"]["value"], rel=2e-3
    )


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_the_page_draws_bode_nyquist_and_sensitivity(folder, row):
    page = browse((folder / "out" / "plant.html").read_text("utf-8"), folder, probe=PROBE)
    assert page["faults"] == []
    assert page["bode"] == ["worst machine", "as drawn (two.xml)", "loop gain"]
    axis = row["loops"][0]
    decibels, phase = 20 * np.log10(axis["gain"]["value"]), axis["phase"]["value"]
    assert page["marks"] == [f"gain {decibels:.1f} dB", f"phase {phase:.1f}°"]
    assert f"modulus margin {axis['modulus']['value']:.2f}" in page["nyquist"]
    assert "critical point" in page["nyquist"]
    assert {"|S|", "|T|"} < set(page["sensitivity"])
    assert page["step"] == 1
    assert page["none"] == "The loop gain stays below one: the loop follows no reference."
    assert page["title"] == "loop gain of base"


def test_a_budget_without_loops_has_no_margins(folder):
    text = (folder / "budget.toml").read_text().split("[noise.encoder]")[0]
    (folder / "open.toml").write_text(text, encoding="utf-8")
    out = folder / "open.json"
    result = run(
        "predict", folder / "two.xml", "--budget", folder / "open.toml", "--json", out,
        "--out", folder / "open",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert json.loads(out.read_text())["budget"]["margins"] is None
    assert "stability margins" not in result.stdout
    page = (folder / "open" / "plant.html").read_text("utf-8")
    assert "Stability margins" not in page
    assert data_of(page)["margins"] is None


def test_what_limits_a_loop_stands_below_its_margins_and_beside_an_unstable_one(folder):
    assert "with a modulus margin of 0.5 the gain of axis may be" in (
        folder / "stdout.txt"
    ).read_text(encoding="utf-8")
    loud = (folder / "budget.toml").read_text().replace("gain = 300000.0", "gain = 3e7")
    (folder / "loud.toml").write_text(loud)
    result = run("predict", folder / "two.xml", "--budget", folder / "loud.toml", "--no-pictures")
    assert result.exit_code == 3
    assert "the closed loop is unstable" in result.stderr
    assert "the gain of axis may be 0.0" in result.stderr
