"""Page of ``mbw identify``: its data, and its behaviour in a browser."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of, unpacked
from campaign_folder import write_folder
from typer.testing import CliRunner

from identification import Fault
from identification.modal import ScaledModes, full_matrix_model
from identification.result.schema import SolidRow
from identification.result.stored_result import IdentificationResult, read_result
from mbmodel import load_machine, machine_geometry
from mbw.command import app
from mbw.identify.files import _modal_model
from mbw.identify.page import render

RUNNER = CliRunner()
PROBE = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
const ends = () => MOVING.map(set => byId("picture").data[set.number].x.slice(-3));
(async () => {
  state.playing = false;
  await wait(1500);
  const rows = document.querySelectorAll("#modes tbody tr"), found = {rows: rows.length};
  found.drawn = drawn;
  phase = 0; await show(); await wait(300);
  if (drawn) found.before = ends();
  rows[2].click();
  await wait(600);
  if (drawn) found.after = ends();
  found.selected = [...rows].findIndex(row => row.getAttribute("aria-selected") === "true");
  found.chosen = byId("chosen").textContent;
  found.picture = byId("picture").textContent.slice(0, 60);
  byId("error-map").emit("plotly_click", {points: [{x: 7, y: 2}]});
  await wait(300);
  found.out = byId("out").value; found.inp = byId("inp").value;
  found.remark = byId("frf-remark").textContent;
  const name = t => t.name + (t.yaxis === "y2" ? " phase" : "");
  found.curves = byId("frf").data.map(name);
  const of = name => byId("frf").data.find(t => t.name === name);  // the first is the magnitude
  const solid = of("as a solid body");
  found.solidCurve = [solid.visible, Array.from(solid.y).slice(0, 20)];
  found.coherence = Array.from(of("coherence").y);
  const legend = [...byId("frf").querySelectorAll(".traces")];
  const toggle = legend.find(t => t.textContent.startsWith("as a solid"));
  for (const kind of ["mousedown", "mouseup"])
    toggle.querySelector(".legendtoggle").dispatchEvent(new MouseEvent(kind));
  await wait(800);
  byId("out").value = "8"; byId("out").onchange();
  await wait(300);
  found.switchedOn = of("as a solid body").visible;
  byId("out").value = "7"; byId("out").onchange();
  await wait(300);
  found.made = Array.from(byId("frf").data.find(t => t.name === "synthesised").y).slice(0, 20);
  const far = [...byId("inp").options].find(option => option.text === "acc6:+ty");
  byId("inp").value = far.value; byId("inp").onchange();
  await wait(300);
  found.far = Array.from(byId("frf").data[0].y).slice(0, 20);
  found.farNames = byId("frf").data.map(name);
  found.stable = byId("indicators").data[4].x.length;
  const kinds = byId("indicators").data.slice(0, 5);
  found.kinds = kinds.map(t => [t.x.length, Math.min(...t.customdata)]);
  byId("indicators").emit("plotly_click", {points: [{x: MODES[1].frequency * 1.001}]});
  found.clicked = state.mode;
  found.mac = byId("auto-mac").data[0].z.map(row => Array.from(row));
  found.other = byId("other-mac").data[0].z.length;
  found.solid = byId("solid").textContent;
  const texts = row => [...row.cells].map(cell => cell.textContent);
  found.solidRows = [...byId("solid-faults").querySelectorAll("tbody tr")].map(texts);
  found.solidWords = byId("solid-faults").textContent;
  found.complexity = byId("complexity").data[1].x.length;
  document.querySelector("#errors button[data-value=frac]").click();
  found.map = byId("error-map").data[0].z.map(row => row.filter(v => v !== null).length);
  found.faults = FAULTS;
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


SOLID = SolidRow(
    body="head",
    channels=9,
    spare=3,
    solid_to=160.0,
    words="moves as a solid <b>up to</b> 160 Hz",
    frequency=[10.0, 20.0, 30.0],
    deviation=[0.001, 0.0, 0.02],
    faults=[
        Fault(
            effect="sensor_position",
            location="sensor:acc4",
            dof=None,
            probability=0.987,
            parameters={"offset": (0.0, 0.0123, -0.004)},
            excess_after=1.02,
        )
    ],
    more=True,
    twins=[("sensor_gain@sensor:acc3:tx", "sensor_misalignment@sensor:acc3")],
    unseen=["sensor_gain@sensor:acc6:tz"],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("identify")
    campaign = write_folder(place / "campaign", lines=321)
    arguments = ["identify", campaign, "--out", place / "result"]
    outcome = RUNNER.invoke(app, [str(argument) for argument in arguments])
    assert outcome.exit_code == 0, outcome.stderr
    return place / "result"


@pytest.fixture(scope="module")
def result(folder):
    return read_result(folder)


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "identify.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def checked(result):
    summary = result.summary.model_copy(update={"solid": [SOLID]})
    seen = machine_geometry(load_machine(Path(summary.model)))
    return render(IdentificationResult(summary, result.arrays, result.layout), seen)


def test_the_page_fetches_nothing(text):
    page = re.sub(r"<script>/\*\*.*?</script>", "", text, flags=re.DOTALL)
    assert len(page) < len(text) / 2  # plotly itself is inside
    assert "src=" not in page
    assert not re.search(r"<link|@import|url\(", page)


def test_the_lead_says_how_many_modes_and_how_well_they_answer(text, result):
    lead = re.search(r'<p class="lead">(.*?)</p>', text)[1]
    assert lead.startswith(f"{len(result.summary.modes)} modes from ")
    assert f"{100 * result.summary.error:.3g} %" in lead
    assert "resemble a mode of pair as drawn" in lead


def test_report_makes_the_same_page_again(folder, text, tmp_path):
    outcome = RUNNER.invoke(app, ["report", str(folder), "--out", str(tmp_path / "again.html")])
    assert outcome.exit_code == 0, outcome.stderr
    assert (tmp_path / "again.html").read_text("utf-8") == text


def test_report_shows_sensors_where_the_model_is_gone(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "moved")
    content = json.loads((tmp_path / "moved" / "modes.json").read_text("utf-8"))
    content["model"] = str(tmp_path / "gone.xml")
    (tmp_path / "moved" / "modes.json").write_text(json.dumps(content), encoding="utf-8")
    outcome = RUNNER.invoke(app, ["report", str(tmp_path / "moved")])
    assert outcome.exit_code == 0, outcome.stderr
    assert "shows sensors alone" in outcome.stderr
    picture = data_of((tmp_path / "moved" / "identify.html").read_text("utf-8"))["picture"]
    assert picture["meshes"] == []
    assert [line["name"] for line in picture["lines"]] == ["base", "head"]
    assert picture["sensors"]["names"] == [f"node {node}" for node in range(1, 7)]


def test_sensors_move_along_world_axes_as_measured(text, result):
    picture = data_of(text)["picture"]
    vectors = unpacked(picture["sensors"]["vectors"], "<c8").reshape(-1, 6, 3)
    shape = np.array(result.summary.modes[0].shape_real).reshape(6, 3)
    np.testing.assert_allclose(vectors[0].real, shape, rtol=1e-5, atol=1e-7)


def test_bodies_move_as_the_solids_that_fit_their_sensors(text, result):
    picture = data_of(text)["picture"]
    shapes = unpacked(picture["shapes"], "<c8").reshape(len(result.summary.modes), 12)
    np.testing.assert_allclose(shapes, result.arrays["body_shapes"].T, rtol=1e-5, atol=1e-7)


def test_names_cannot_break_the_page(result):
    evil = result.summary.model_copy(update={"campaign": "</script><b>x"})
    page = render(IdentificationResult(evil, result.arrays, result.layout), None)
    assert "<b>x" not in page


@pytest.fixture(scope="module")
def found(checked, tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    return browse(checked, tmp_path_factory.mktemp("browser"), *GL, probe=PROBE)


def test_the_page_runs_without_faults(found, result):
    assert found["faults"] == []
    assert found["drawn"]
    assert found["rows"] == found["other"] == len(result.summary.modes)


def test_a_click_on_a_mode_moves_bodies_and_sensors_alike(found):
    assert found["selected"] == 2
    assert found["chosen"].startswith("Mode 3: ")
    for before, after in zip(found["before"], found["after"], strict=True):
        pairs = [(a, b) for a, b in zip(before, after, strict=True) if a is not None]
        assert max(abs(a - b) for a, b in pairs) > 1e-4
    assert found["complexity"] == 18


def test_a_click_on_the_map_chooses_the_frf_that_is_synthesised_as_by_python(found, result):
    assert (found["out"], found["inp"]) == ("7", "2")
    assert found["curves"] == [
        "noise, one standard deviation", "difference", "measured", "measured phase",
        "as a solid body", "as a solid body phase", "synthesised", "synthesised phase",
        "by shapes and modal A alone",
        "by shapes and modal A alone phase", "coherence",
    ]  # fmt: skip
    expected = np.abs(result.arrays["synthesised"][:20, 7, 2])
    np.testing.assert_allclose(found["made"], expected, rtol=1e-4)
    error = 100 * result.arrays["channel_error"][7, 2]
    assert float(re.match(r"Error (\S+) %", found["remark"])[1]) == pytest.approx(error, rel=0.01)


def test_an_input_that_was_not_hit_is_synthesised_by_shapes_and_modal_a(found, result):
    whole = ScaledModes(
        _modal_model(result), result.summary.normalisation, result.arrays["modal_a"], np.zeros(0)
    )
    full = full_matrix_model(whole, result.arrays["in_full_matrix"])
    values = full.synthesise(result.arrays["freq_hz"], "accelerance").values
    column = result.summary.outputs.index("acc6:+ty")
    np.testing.assert_allclose(found["far"], np.abs(values[:20, 7, column]), rtol=1e-3)
    assert len(found["farNames"]) == 3  # the last is the place of the coherence, which is empty


def test_the_chosen_frf_has_its_coherence_and_its_body_as_a_solid(found, result):
    visible, curve = found["solidCurve"]
    assert visible == "legendonly"
    np.testing.assert_allclose(curve, np.abs(result.arrays["as_solid"][:20, 7, 2]), rtol=1e-5)
    np.testing.assert_allclose(found["coherence"], result.arrays["coherence"][:, 7, 2], rtol=1e-6)
    seen, solid = (result.arrays[name][:, 7, 2] for name in ("measured", "as_solid"))
    apart = 100 * np.linalg.norm(seen - solid) / np.linalg.norm(seen)
    said = re.search(r"Difference to the motion of a solid body: (\S+) %", found["remark"])[1]
    assert float(said) == pytest.approx(apart, rel=0.01)


def test_a_curve_that_was_switched_on_stays_on_for_other_frfs(found):
    assert found["switchedOn"] is True


def test_poles_of_negative_damping_are_not_among_the_stable(found, result):
    assert found["stable"] > 5 * len(result.summary.modes)
    assert all(least > 0 for count, least in found["kinds"][1:] if count)


def test_a_click_in_the_diagram_chooses_the_nearest_mode(found):
    assert found["clicked"] == 1


def test_mac_and_map_are_there(found, result):
    count = len(result.summary.modes)
    np.testing.assert_allclose(found["mac"], result.arrays["auto_mac"][:count, :count], atol=1e-5)
    assert found["map"] == result.arrays["is_measured"].sum(axis=0).tolist()


def test_checks_of_solid_bodies_have_their_room(found):
    assert "head93160.0moves as a solid <b>up to</b> 160 Hz" in found["solid"]


def test_faults_confounded_and_unidentifiable_ones_are_listed_as_text(found):
    fault, hidden = found["solidRows"]
    assert fault == [
        "head", "position", "acc4", "all", "offset 0, 12.3, -4 mm", "98.7 %", "1.02",
    ]  # fmt: skip
    assert hidden == ["head", "acc3 tx: gain = acc3: misalignment", "acc6 tz: gain"]
    assert "A significant residual remains on head." in found["solidWords"]


def test_without_raw_records_there_is_no_section_of_hits(text, result):
    assert result.summary.hits == []
    assert "<h2>Hits</h2>" not in text
    assert data_of(text)["hits"] == []


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_without_webgl_a_sentence_stands_for_the_picture_and_the_rest_works(text, tmp_path):
    bare = browse(text, tmp_path, "--disable-3d-apis", probe=PROBE)
    assert bare["picture"].startswith("No 3-D picture")
    assert bare["faults"] == []
    assert bare["selected"] == 2
    assert "moves as a solid up to 165 Hz" in bare["solid"]
