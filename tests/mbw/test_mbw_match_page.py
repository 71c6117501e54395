"""Page of ``mbw match``: its data, and its behaviour in a browser."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from mbw.command import app
from mbw.match.circles import base_channel
from mbw.match.page import render
from mbw.match.result import read_result
from tests.helpers.browser import CHROMIUM, GL, browse, data_of, unpacked
from tests.helpers.virtual_gondola import Trial, read_structure, write_impacts

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
PROBE = """<script>setTimeout(() => {
  const found = {faults: FAULTS, rows: rowsOf().length};
  found.hands = document.querySelectorAll("#hands tbody tr").length;
  const vertices = () => byId("picture").data.find(t => t.type === "mesh3d");
  found.kinds = byId("picture").data?.map(t => t.type);
  choose(3);
  setTimeout(() => {
    found.chosen = byId("chosen").textContent;
    found.evidence = byId("evidence").textContent;
    found.moved = Math.max(...vertices().x.map((v, k) => Math.abs(v - SURFACE.points[3 * k])));
    found.ratio = byId("ratio").data.map(t => t.name);
    found.close = byId("closeness").data.length;
    const circle = () => byId("circle").data;
    found.circles = document.querySelectorAll("#circles tbody tr").length;
    found.traces = circle().map(t => t.name);
    const points = trace => trace.x.map((x, k) => [x, trace.y[k]]);
    found.half = [...points(circle()[3]), points(circle()[4])[1]];
    const first = byId("circle").layout.title.text;
    document.querySelectorAll("#circles tbody tr")[0].click();
    found.titles = [first, byId("circle").layout.title.text];
    found.sentence = byId("circle-text").textContent;
    found.lines = byId("spectra").layout.shapes.length;
    document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
  }, 1500);
}, 2500);</script>"""


@pytest.fixture(scope="module")
def matched(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gondola")
    structure = read_structure(ASSETS / "truths.npz", 11)  # for development alone
    trial = Trial(71_703, seconds=6.0)
    points = ("bow2", "bow3", "stern2")
    write_impacts(folder / "test", structure, trial, points, ASSETS / "layout.toml")
    words = ["match", str(ASSETS / "shapes.vtu"), str(folder / "test"), "--quiet"]
    done = CliRunner().invoke(app, [*words, "--out", str(folder / "out")])
    assert done.exit_code == 0, done.output
    return folder / "out"


def test_sensors_are_drawn_in_the_size_of_the_simulated_shape(matched):
    result = read_result(matched)
    data = data_of((matched / "match.html").read_text("utf-8"))
    arrays, rows = result.arrays, data["modes"]
    assert len(rows) == len(result.summary.modes) + len(result.summary.unmatched)
    names = data["picture"]["sensors"]["names"]
    vectors = unpacked(data["picture"]["sensors"]["vectors"], "<c8")
    vectors = vectors.reshape(len(rows), len(names), 3).real
    for number, row in enumerate(result.summary.modes):
        at = arrays["at"][list(arrays["numbers"]).index(row.simulated)]
        sites = [names.index(label.partition(":")[0]) for label in result.summary.channels]
        seen = np.einsum("cx,cx->c", vectors[number][sites], arrays["channel_axes"])
        shape = np.array(row.shape)
        assert seen == pytest.approx(shape * (at @ shape) / (shape @ shape), abs=1e-5)
        assert (seen @ at) ** 2 / (seen @ seen) / (at @ at) == pytest.approx(row.mac, abs=1e-4)
    assert data["reference"] in data["places"]
    surface = unpacked(data["picture"]["surface"]["vectors"])
    assert len(surface) == len(rows) * arrays["points"].size


def test_circles_of_the_page_are_those_of_the_result(matched):
    result = read_result(matched)
    packed = data_of((matched / "match.html").read_text("utf-8"))["circles"]
    count, channels = len(result.summary.modes), len(result.summary.channels)
    values = unpacked(packed["values"], "<c8").reshape(count, channels, packed["lines"])
    centre = unpacked(packed["centre"], "<c8").reshape(count, channels)
    radius = unpacked(packed["radius"]).reshape(count, channels)
    fitted = unpacked(packed["fitted"], "<i4").reshape(count, -1).astype(bool)
    for number, row in enumerate(result.summary.modes[:6]):  # the others are at the band's end
        assert [circle.channel for circle in row.circles] == result.summary.channels
        strongest = row.circles[base_channel(row)]
        assert strongest.frequency == pytest.approx(row.frequency, rel=0.01)
        assert strongest.damping == pytest.approx(row.damping, rel=0.25)
        k = result.summary.channels.index(strongest.channel)
        # The lines of the fit lie on the circle, within its scatter.
        distance = np.abs(values[number, k, fitted[number]] - centre[number, k])
        rms = np.sqrt(np.mean((distance / radius[number, k] - 1) ** 2))
        assert rms == pytest.approx(strongest.scatter, abs=0.02)
        assert rms < 0.1


def test_a_report_of_a_match_is_its_page_again(matched, tmp_path):
    target = str(tmp_path / "again.html")
    done = CliRunner().invoke(app, ["report", str(matched), "--out", target])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "again.html").read_text("utf-8") == render(read_result(matched))
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "match.json").write_text("{}")
    refused = CliRunner().invoke(app, ["report", str(broken)])
    assert refused.exit_code == 3
    assert "run mbw match again" in " ".join(refused.output.split())


@pytest.mark.skipif(CHROMIUM is None, reason="no browser")
def test_the_page_works_in_a_browser(matched, tmp_path):
    page = (matched / "match.html").read_text("utf-8")
    found = browse(page, tmp_path, *GL, probe=PROBE)
    assert found["faults"] == []
    assert found["rows"] == 8
    assert found["hands"] >= 10
    assert "mesh3d" in found["kinds"]
    assert found["chosen"].startswith("Mode 4")
    assert found["evidence"].startswith(
        "Channels that distinguish this match from the next candidate: acc"
    )
    assert found["moved"] > 0
    assert found["ratio"][-1].startswith("simulated mode")
    assert found["close"] == 4
    assert found["lines"] >= 4 * 6
    assert found["circles"] == 21
    assert found["traces"][2:] == ["circle", "half-power points", "natural frequency"]
    low, high, top = np.array(found["half"])
    across, up = high - low, top - (low + high) / 2
    assert abs(across @ up) < 1e-6 * np.linalg.norm(across) * np.linalg.norm(up)
    assert np.cross([*(low - (low + high) / 2), 0], [*up, 0])[2] < 0  # 9 o'clock is below the peak
    assert found["titles"][0] != found["titles"][1]
    assert found["titles"][1] == "acc1 x, mode 4"
    assert found["sentence"].startswith("acc1 x, ")
