"""Page of ``mbw predict``: its data, and its behaviour in a browser."""

import re

import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of, unpacked
from small_machine import MJCF
from typer.testing import CliRunner

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine, model_modes, shapes_at
from mbw.command import app

RUNNER = CliRunner()
FRFS = ("--input", "acc3:+x", "--output", "acc1:+z", "--output", "head:-rz")
PROBE = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
const seen = () => drawn ? byId("picture").data[MOVING[0].number].x.slice(0, 8) : null;
(async () => {
  state.playing = false;
  await wait(1500);
  const rows = document.querySelectorAll("#modes tbody tr"), found = {rows: rows.length};
  phase = 0; await show(); await wait(300);
  found.before = seen();
  rows[4].click();
  await wait(600);
  found.after = seen();
  found.selected = [...rows].findIndex(row => row.getAttribute("aria-selected") === "true");
  found.chosen = byId("chosen").textContent;
  found.curves = byId("bode").data.filter(t => t.showlegend !== false).map(t => t.name);
  found.heat = byId("energy").data[0].z.length;
  found.picture = byId("picture").textContent.slice(0, 60);
  phase = 0; before = 1000; state.playing = true; busy = false;
  const show_ = show; show = () => { found.shown = true; };  // no frames come when headless
  const frame = requestAnimationFrame; requestAnimationFrame = () => 0;
  step(1050);
  show = show_; requestAnimationFrame = frame; state.playing = false;
  found.played = phase;
  found.faults = FAULTS;
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("page")
    (place / "pair.xml").write_text(MJCF, encoding="utf-8")
    arguments = ["predict", place / "pair.xml", "--modes", "--out", place, *FRFS]
    result = RUNNER.invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.stderr
    return place


@pytest.fixture(scope="module")
def model(folder):
    return as_drawn(load_machine(folder / "pair.xml"))


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "predict.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def data(text):
    return data_of(text)


def test_the_page_fetches_nothing(text):
    page = re.sub(r"<script>/\*\*.*?</script>", "", text, flags=re.DOTALL)
    assert len(page) < len(text) / 2  # plotly itself is inside
    assert "src=" not in page
    assert not re.search(r"<link|@import|url\(", page)


def test_the_picture_moves_as_the_modes_do(model, data):
    found = model_modes(model, model.drawn)
    expected = shapes_at(model, model.drawn, found, model.machine.layout.body_dofs())
    shapes = unpacked(data["picture"]["shapes"], "<c8").reshape(len(found.poles), -1)
    assert shapes == pytest.approx(expected.T, rel=1e-5, abs=1e-6)


def test_the_bode_plot_holds_the_requested_frfs(model, data):
    bode = data["bode"]
    assert bode["labels"] == ["acc1:+tz / acc3:+tx", "head:-rz / acc3:+tx"]
    assert bode["units"] == ["m/s² per N", "rad/s² per N"]
    freq = unpacked(bode["freq"]).astype(float)
    outputs = (Dof("acc1", "+tz"), Dof("head", "-rz"))
    question = FrfRequest(freq, outputs, (Dof("acc3", "+tx"),))
    expected = Evaluator(model, question).at(model.drawn).values[:, :, 0].T
    values = unpacked(bode["values"], "<c8").reshape(2, -1)
    assert np.abs(values - expected).max() < 1e-3 * np.abs(expected).max()


def test_the_shares_in_the_heat_map_add_up_to_one(data):
    for kind in ("strain", "kinetic", "dissipation"):
        table = data["energy"][kind]
        shares = unpacked(table["values"]).reshape(len(table["names"]), -1)
        assert shares.shape[1] == len(data["energy"]["modes"]) > 0
        assert shares.sum(axis=0) == pytest.approx(1.0, abs=0.01)


def test_names_cannot_break_the_page(tmp_path):
    evil = MJCF.replace('model="pair"', 'model="&lt;/script>&lt;b>x"')
    (tmp_path / "evil.xml").write_text(evil, encoding="utf-8")
    result = RUNNER.invoke(app, ["predict", str(tmp_path / "evil.xml"), "--out", str(tmp_path)])
    assert result.exit_code == 0, result.stderr
    assert "<b>x" not in (tmp_path / "predict.html").read_text(encoding="utf-8")


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_a_click_on_a_mode_changes_the_picture(text, model, tmp_path):
    found = browse(text, tmp_path, *GL, probe=PROBE)
    assert found["faults"] == []
    assert found["rows"] == len(model_modes(model, model.drawn).poles)
    assert found["selected"] == 4
    assert found["chosen"].startswith("Mode 5: ")
    assert len(found["before"]) == 8
    assert np.abs(np.subtract(found["before"], found["after"])).max() > 1e-3
    assert found["shown"]
    assert found["played"] == pytest.approx(2 * np.pi * 50 / 1800)
    assert [name.split(" [")[0] for name in found["curves"]] == [
        "acc1:+tz / acc3:+tx",
        "head:-rz / acc3:+tx",
    ]
    assert found["heat"] == 6


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_without_webgl_a_sentence_stands_for_the_picture_and_the_rest_works(text, tmp_path):
    found = browse(text, tmp_path, "--disable-3d-apis", probe=PROBE)
    assert found["picture"].startswith("No 3-D picture")
    assert found["faults"] == []
    assert found["selected"] == 4
    assert len(found["curves"]) == 2
