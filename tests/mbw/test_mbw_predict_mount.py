"""``mbw predict --mount`` and ``--add-mass``: before and after, in text, on the page, in JSON."""

import csv
import io
import json

import mujoco
import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of, unpacked
from small_machine import MJCF
from typer.testing import CliRunner

from mbmodel import as_drawn, load_machine, model_modes
from mbw.command import app

RUNNER = CliRunner()
STAGE = """
<mujoco model="active">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="platform">
      <joint name="platform_tx" type="slide" axis="1 0 0" stiffness="1.2e6" damping="60"/>
      <geom type="box" size="0.1 0.1 0.02" mass="4"/>
      <site name="acc31" pos="0.05 0 0.02"/>
    </body>
  </worldbody>
</mujoco>
"""
PROBE = """<script>
(async () => {
  await new Promise(done => setTimeout(done, 1500));
  const plot = byId("bode"), found = {
    curves: plot.data.filter(t => t.showlegend !== false)
      .map(t => [t.name, t.line.dash || "solid"]),
    ticks: plot.layout.shapes.filter(s => s.y1 < 0.4).length,
    rows: [...document.querySelectorAll("h2")].find(h => h.textContent === "Before and after")
      .parentElement.querySelectorAll("table.tight tbody tr").length,
    remark: byId("bode-remark").textContent, faults: FAULTS};
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mount")
    (folder / "pair.xml").write_text(MJCF, encoding="utf-8")
    (folder / "stage.xml").write_text(STAGE, encoding="utf-8")
    return folder


def run(place, *arguments, out="result"):
    call = ["predict", place / "pair.xml", "--out", place / out, *arguments]
    return RUNNER.invoke(app, [str(argument) for argument in call])


MOUNT = ("--at", "head:0.05,0,0.1", "--add-mass", "platform=1.5@0,0,0.05")
FRFS = ("--input", "head:+tx", "--output", "head:+tx", "--output", "acc31:+tx")


@pytest.fixture(scope="module")
def result(place):
    call = run(
        place, "--mount", place / "stage.xml", *MOUNT, *FRFS, "--json", place / "result.json"
    )
    assert call.exit_code == 0, call.stderr
    return call


@pytest.fixture(scope="module")
def document(place, result):
    return json.loads((place / "result.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def summary(document):
    return document["put_on_top"]


def test_the_combined_machine_is_written_and_has_the_modes_of_the_json(place, document, summary):
    path = place / "result" / "combined.xml"
    assert mujoco.MjModel.from_xml_path(str(path)).nv == 7
    model = as_drawn(load_machine(path))
    listed = [row["frequency"] for row in document["modes"]]
    assert listed == pytest.approx(model_modes(model, model.drawn).freq_hz, rel=1e-9)
    assert summary["combined"] == "combined.xml"
    assert summary["at"] == "head:0.05,0,0.1"
    assert summary["added_masses"] == [{"body": "platform", "mass": 1.5, "offset": [0, 0, 0.05]}]


def test_modes_are_paired_by_the_motion_of_the_common_bodies(place, document, summary):
    alone = as_drawn(load_machine(place / "pair.xml"))
    before = [row["frequency"] for row in summary["before"]]
    assert before == pytest.approx(model_modes(alone, alone.drawn).freq_hz, rel=1e-9)
    assert len(summary["pairs"]) == 6
    assert len(summary["new"]) == 1
    assert summary["gone"] == []
    for row in summary["pairs"]:
        assert 0.5 <= row["mac"] <= 1 + 1e-12
        change = document["modes"][row["after"]]["frequency"] / before[row["before"]] - 1
        assert row["frequency_change"] == pytest.approx(change, abs=1e-12)
    # What does not move with the stage's direction keeps its mode exactly but for the added mass.
    heave = max(summary["pairs"], key=lambda row: row["mac"])
    assert heave["mac"] > 0.999


def test_the_table_names_the_new_mode(result):
    assert "before and after stage.xml on head, 1.5 kg on platform:" in result.stdout
    assert sum("new" in line for line in result.stdout.splitlines()) == 1


def test_the_page_holds_the_frfs_before_and_after(place, summary):
    text = (place / "result" / "predict.html").read_text("utf-8")
    bode = data_of(text)["bode"]
    values, before = (unpacked(bode[key], "<c8").reshape(2, -1) for key in ("values", "before"))
    assert bode["labels"] == ["head:+tx / head:+tx", "acc31:+tx / head:+tx"]
    assert np.isfinite(values).all()
    assert np.isnan(before[1]).all()  # the machine alone has no acc31
    rows = summary["frfs"]
    assert rows[0]["peak_after"] == pytest.approx(np.abs(values[0]).max(), rel=1e-6)
    assert rows[0]["peak_before"] == pytest.approx(np.abs(before[0]).max(), rel=1e-6)
    assert rows[1]["peak_before"] is None
    freq = unpacked(bode["freq"]).astype(float)
    plain = run(place, "--frf", "--no-pictures", *FRFS[:4], "--lines", "401", out="plain")
    table = np.array(list(csv.reader(io.StringIO(plain.stdout)))[1:], float)
    csv_size = np.abs(table[:, 1] + 1j * table[:, 2])
    drawn = np.interp(table[4:, 0], freq, np.abs(before[0]))
    assert drawn == pytest.approx(csv_size[4:], rel=0.02)


def test_a_prediction_without_additions_has_neither_keys_nor_curves_before(place):
    call = run(place, "--json", "-", out="alone")
    assert call.exit_code == 0, call.stderr
    assert "put_on_top" not in json.loads(call.stdout)
    text = (place / "alone" / "predict.html").read_text("utf-8")
    assert "before" not in data_of(text)["bode"]
    assert "Before and after" not in text
    assert not (place / "alone" / "combined.xml").exists()


def test_without_pictures_the_combined_machine_is_still_written(place):
    call = run(place, "--add-mass", "head=2@0,0,0", "--no-pictures", "--modes", out="bare")
    assert call.exit_code == 0, call.stderr
    assert sorted(path.name for path in (place / "bare").glob("[!.]*")) == ["combined.xml"]
    masses = mujoco.MjModel.from_xml_path(str(place / "bare" / "combined.xml")).body_mass
    assert masses.sum() == pytest.approx(120 + 35 + 2)


def test_a_hinge_of_the_stage_can_spin(place):
    rotor = STAGE.replace("</body>", '<body name="rotor"><joint name="rotor_rz" type="hinge" '
                          'axis="0 0 1"/><geom size="0.05" mass="1"/></body></body>')  # fmt: skip
    (place / "rotor.xml").write_text(rotor, encoding="utf-8")
    call = run(
        place, "--mount", place / "rotor.xml", "--at", "head:0,0,0", "--spin", "rotor_rz=300",
        "--no-pictures", out="spun",
    )  # fmt: skip
    assert call.exit_code == 0, call.stderr


BAD = {
    "stage is missing": (("--mount", "{}/none.xml", "--at", "head:0,0,0"), 3, "does not exist"),
    "stage is no XML": (("--mount", "{}/bad.xml", "--at", "head:0,0,0"), 3, "not well-formed"),
    "stage is no MJCF": (("--mount", "{}/robot.xml", "--at", "head:0,0,0"), 3, "robot.xml"),
    "stage is empty": (("--mount", "{}/empty.xml", "--at", "head:0,0,0"), 3, "no body to mount"),
    "body unknown": (("--mount", "{}/stage.xml", "--at", "foot:0,0,0"), 3, "no moving body 'foot'"),
    "site unknown": (("--mount", "{}/stage.xml", "--at", "head:top"), 3, "has no site 'top'"),
    "site of another body": (("--mount", "{}/stage.xml", "--at", "head:acc1"), 3, "no site 'acc1'"),
    "mass of unknown body": (("--add-mass", "foot=2@0,0,0"), 3, "no moving body 'foot'"),
    "negative mass": (("--add-mass", "head=-2@0,0,0"), 3, "give a mass above 0"),
    "mass of nothing": (("--add-mass", "head=0@0,0,0"), 3, "give a mass above 0"),
    "place in millimetres": (("--add-mass", "head=2@0,0,12000"), 3, "up to 1000 m"),
    "no number": (("--add-mass", "head=heavy@0,0,0"), 2, "write BODY=KG@x,y,z"),
    "no place": (("--add-mass", "head=2"), 2, "write BODY=KG@x,y,z"),
    "not finite": (("--add-mass", "head=nan@0,0,0"), 2, "write BODY=KG@x,y,z"),
    "two numbers": (("--add-mass", "head=2@0,0"), 2, "three numbers"),
    "at without mount": (("--at", "head:0,0,0"), 2, "add --mount"),
    "mount without at": (("--mount", "{}/stage.xml"), 2, "add --at"),
    "at without place": (("--mount", "{}/stage.xml", "--at", "head"), 2, "write BODY:SITE"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_additions_end_with_a_sentence(place, case):
    (place / "bad.xml").write_text("<mujoco><worldbody>", encoding="utf-8")
    (place / "robot.xml").write_text('<robot name="r"><link name="l"/></robot>', encoding="utf-8")
    (place / "empty.xml").write_text("<mujoco><worldbody/></mujoco>", encoding="utf-8")
    arguments, code, words = BAD[case]
    call = run(place, *(argument.format(place) for argument in arguments), out="bad")
    assert call.exit_code == code, call.output
    assert words in " ".join(call.stderr.split())
    assert call.stderr.count("mbw:") <= 1
    assert not (place / "bad").exists()


def test_a_file_that_is_read_is_never_replaced(place):
    folder = place / "own"
    folder.mkdir()
    (folder / "combined.xml").write_text(MJCF, encoding="utf-8")
    call = RUNNER.invoke(
        app,
        ["predict", str(folder / "combined.xml"), "--add-mass", "head=2@0,0,0", "--out",
         str(folder), "--overwrite"],
    )  # fmt: skip
    assert call.exit_code == 3
    assert "would replace a file that is read" in " ".join(call.stderr.split())
    assert (folder / "combined.xml").read_text("utf-8") == MJCF


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_page_draws_both_in_one_picture(place, result, tmp_path):
    text = (place / "result" / "predict.html").read_text("utf-8")
    found = browse(text, tmp_path, *GL, probe=PROBE)
    assert found["faults"] == []
    curves = [(name.split(" [")[0], dash) for name, dash in found["curves"]]
    assert curves == [
        ("head:+tx / head:+tx", "solid"),
        ("head:+tx / head:+tx, before", "dot"),
        ("acc31:+tx / head:+tx", "solid"),
    ]
    assert found["ticks"] >= 6
    assert found["rows"] == 7
    assert found["remark"].startswith("Solid: with what is put on the machine")
