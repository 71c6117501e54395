"""The grid of channels that the page of ``mbw identify`` reconstructs from six motions a body."""

import json

import numpy as np
import pytest
import scipy.io
from browser import CHROMIUM, GL, browse
from campaign_folder import write_folder
from small_machine import MJCF
from typer.testing import CliRunner

from identification.words import Dof
from mbmodel import load_machine
from mbw.command import app

RUNNER = CliRunner()
GAIN = 1.3  # of the faulty channel acc4:+tx
PROBE = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
const told = () => {
  const plot = byId("solid-grid"), name = plot.layout.annotations.map(a => a.text);
  return {
    body: state.body, titles: name, verdict: plot.layout.annotations.at(-2),
    names: Array.from(new Set(plot.data.map(t => t.name))), count: plot.data.length,
    axes: Object.keys(plot.layout).filter(key => key.startsWith("yaxis")).length,
    curves: Object.fromEntries(plot.data.map(t => [t.name + " " + t.yaxis, Array.from(t.y)])),
    words: byId("solid-words").textContent,
  };
};
(async () => {
  state.playing = false;
  await wait(1500);
  const found = {first: told()}, nav = byId("solid-nav");
  found.dots = [...nav.querySelectorAll("button[data-key=body] i")].map(dot => dot.className);
  byId("solid-inp").value = "1"; byId("solid-inp").onchange();
  await wait(200);
  found.second = told();
  nav.querySelector("button[data-value=phase]").click();
  await wait(200);
  found.phase = told();
  nav.querySelector("button[data-value=base]").click();
  await wait(200);
  found.base = told();
  found.faults = FAULTS;
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("identify")
    campaign = write_folder(place / "campaign", lines=121)
    measured = scipy.io.loadmat(campaign / "impact.mat")
    measured["FRFs"][9] *= GAIN
    kept = {name: measured[name] for name in ("FRFs", "COHs", "freqs")}
    scipy.io.savemat(campaign / "impact.mat", kept)
    outcome = RUNNER.invoke(app, ["identify", str(campaign), "--out", str(place / "result")])
    assert outcome.exit_code == 0, outcome.stderr
    return place / "result"


@pytest.fixture(scope="module")
def content(folder):
    return json.loads((folder / "modes.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def found(folder, tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    text = (folder / "identify.html").read_text("utf-8")
    return browse(text, tmp_path_factory.mktemp("browser"), *GL, probe=PROBE)


@pytest.fixture(scope="module")
def expected(folder, content, tmp_path_factory):
    """Measured and reconstructed FRFs of the head for all inputs, by plain least squares."""
    model = tmp_path_factory.mktemp("model") / "model.xml"
    model.write_text(MJCF, encoding="utf-8")
    layout = load_machine(model).layout
    channels = [k for k, label in enumerate(content["outputs"]) if label[3] in "346"]
    body = layout.bodies.index("head")
    dofs = [Dof.parse(content["outputs"][k]) for k in channels]
    rows = layout.rows(dofs)[:, 6 * body : 6 * body + 6]
    with np.load(folder / "modes.npz") as arrays:
        measured = arrays["measured"][:, channels]
    flat = np.moveaxis(measured, 1, 0).reshape(len(channels), -1)
    solid = rows @ np.linalg.lstsq(rows, flat, rcond=None)[0]
    return measured, np.moveaxis(solid.reshape(len(channels), *measured.shape[::2]), 0, 1)


def test_the_page_opens_with_the_worst_body_and_its_verdict(found, content):
    assert found["faults"] == []
    head = next(row for row in content["solid"] if row["body"] == "head")
    assert head["faults"]
    assert found["first"]["body"] == "head"
    assert found["first"]["verdict"]["text"].startswith("head: solid up to ")
    assert found["first"]["verdict"]["text"].endswith(", acc4: gain")
    assert found["first"]["verdict"]["bgcolor"] == "#b42318"
    assert found["first"]["words"] == head["words"]
    assert sorted(found["dots"]) == ["dot good", "dot trouble"]


def test_every_channel_has_its_measured_and_its_reconstructed_curve(found, expected):
    assert found["first"]["names"] == ["measured", "reconstructed from six motions"]
    assert (found["first"]["axes"], found["first"]["count"]) == (9, 18)
    for column, key in enumerate(("first", "second")):
        for channel in range(9):
            axis = "y" if channel == 0 else f"y{channel + 1}"
            for name, values in zip(found[key]["names"], expected, strict=True):
                curve = found[key]["curves"][f"{name} {axis}"]
                np.testing.assert_allclose(curve, np.abs(values[:, channel, column]), rtol=1e-4)


def test_the_phase_is_shown_on_request(found, expected):
    shown = np.array(found["phase"]["curves"]["measured y2"], float)
    angle = np.degrees(np.angle(expected[0][:, 1, 1]))
    known = np.isfinite(shown)
    assert known.sum() > 80
    np.testing.assert_allclose(shown[known], angle[known], atol=0.01)


def test_each_title_states_how_far_the_body_is_from_a_solid_there(found, expected):
    measured, solid = (values[:, 3, 0] for values in expected)
    difference = 100 * np.linalg.norm(measured - solid) / np.linalg.norm(measured)
    assert difference > 5  # the wrong gain shows
    label, text = found["first"]["titles"][3].split("   difference ")
    assert label == "acc4:+tx"
    assert float(text.removesuffix(" %")) == pytest.approx(difference, rel=0.05)


def test_a_sound_body_is_green(found):
    assert found["base"]["body"] == "base"
    assert found["base"]["verdict"]["bgcolor"] == "#2f7d4a"
    assert "fault" not in found["base"]["verdict"]["text"]
