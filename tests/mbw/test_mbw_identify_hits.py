"""``mbw identify`` on raw time records: hits in its JSON, its numbers and its page."""

import json
import re
import shutil

import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of, unpacked
from hammer_records import Hammer, System, channel_functions, strike
from small_machine import MJCF
from typer.testing import CliRunner

from identification.result.hits import _average_neighbours
from identification.result.stored_result import read_result
from identification.words import Dof
from mbmodel import as_drawn, load_machine, model_modes, shapes_at
from mbw.command import app
from tuning import open_campaign

RUNNER = CliRunner()
CHANNELS = tuple(f"{node}:+{axis}" for node in range(1, 7) for axis in "xyz")
DAMPING = 0.004  # so little that it takes an exponential window
PROBE = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
(async () => {
  state.playing = false;
  await wait(1500);
  const found = {}, plot = byId("hits-plot");
  const rows = () => [...document.querySelectorAll("#hits tbody tr")];
  const curve = axis => Array.from(plot.data.filter(t => (t.yaxis || "y") === axis).pop().y);
  found.heads = [...document.querySelectorAll("#hits th")].map(cell => cell.textContent);
  found.rows = rows().map(row => [...row.cells].map(cell => cell.textContent));
  found.names = plot.data.map(t => t.name);
  found.titles = ["xaxis", "yaxis", "yaxis2"].map(axis => plot.layout[axis].title.text);
  found.first = [curve("y"), curve("y2")];
  rows().pop().click();
  await wait(200);
  byId("hits-motion").value = "8"; byId("hits-motion").onchange();
  await wait(200);
  found.second = [curve("y"), curve("y2")];
  found.chosen = [byId("hits-force").value, byId("hits-motion").value];
  const curves = id => byId(id).data.map(t => [t.name, Array.from(t.x), Array.from(t.y)]);
  found.normalised = curves("hits-normalised");
  found.record = curves("hits-time");
  found.marks = byId("hits-time").layout.shapes.map(mark => mark.x0);
  document.querySelector("#hits-chosen button[data-value=block]").click();
  await wait(200);
  found.block = curves("hits-time");
  found.coherence = Array.from(byId("frf").data.find(t => t.name === "coherence").y);
  found.faults = FAULTS;
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


def write_campaign(folder):
    """Two references of the small machine with little damping; one weak hit, one double hit."""
    folder.mkdir(parents=True)
    (folder / "model.xml").write_text(MJCF, encoding="utf-8")
    (folder / "campaign.toml").write_text(
        'model = "model.xml"\n[[test]]\nfile = "hits.uff"\n', encoding="utf-8"
    )
    model = as_drawn(load_machine(folder / "model.xml"))
    found = model_modes(model, model.drawn)
    kept = found.poles.imag > 0
    outputs = tuple(Dof.of(f"acc{node}", axis) for node in range(1, 7) for axis in range(3))
    shapes = shapes_at(model, model.drawn, found, outputs)[:, kept]
    turn = shapes[np.abs(shapes).argmax(axis=0), np.arange(kept.sum())]
    real = np.real(shapes * np.abs(turn) / turn)  # proportional damping, still reciprocal
    damping = np.full(kept.sum(), DAMPING)
    content = b""
    for number, (reference, row, sign) in enumerate((("3:+x", 6, 1), ("3:-y", 7, -1))):
        system = System(found.freq_hz[kept], damping, real, sign * real[row])
        hammer = Hammer(
            rate_hz=1000.0, duration_s=8.0, noise=2e-3, force_noise=0.02, seed=number,
            times_s=((0.3, 2.3, 4.3), (0.3, 2.35, 4.25)),
            peaks_n=((180.0, 210.0, 20.0), (200.0, 170.0, 190.0)) if number == 0 else None,
            outputs=CHANNELS, reference=reference,
        )  # fmt: skip
        functions = channel_functions(strike(system, hammer), order="<")
        content += b"".join(function.content() for function in functions)
    (folder / "hits.uff").write_bytes(content)
    return folder


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return write_campaign(tmp_path_factory.mktemp("raw") / "campaign")


@pytest.fixture(scope="module")
def folder(campaign, tmp_path_factory):
    place = tmp_path_factory.mktemp("identified") / "result"
    outcome = RUNNER.invoke(app, ["identify", str(campaign), "--out", str(place)])
    assert outcome.exit_code == 0, outcome.stderr
    return place


@pytest.fixture(scope="module")
def tests(campaign):
    """What the estimates themselves say."""
    return open_campaign(campaign, None)[2].tests


@pytest.fixture(scope="module")
def content(folder):
    return json.loads((folder / "modes.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def result(folder):
    return read_result(folder)


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "identify.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def found(text, tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    return browse(text, tmp_path_factory.mktemp("browser"), *GL, probe=PROBE)


def test_each_reference_has_a_row_of_its_hits(content):
    first, second = content["hits"]
    assert [first["reference"], second["reference"]] == ["acc3:+tx", "acc3:-ty"]
    assert [len(row["kept"]) for row in (first, second)] == [5, 6]
    (gone,) = first["rejected"]
    assert (gone["record"], gone["hit"]) == (1, 3)
    assert gone["time"] == pytest.approx(4.3, abs=0.01)
    assert gone["reason"].startswith("weak: ")
    assert second["rejected"] == []
    assert first["kept"][1]["peak"] == pytest.approx(210, rel=0.05)
    assert first["estimator"] == "H1"
    assert first["rate"] == 1000.0
    assert 0 < first["pretrigger"] < 0.1 * first["block"]
    assert first["force_window"] < 0.1 * first["block"]


def test_the_window_says_what_it_adds_to_each_damping_and_that_is_gone(content):
    row = content["hits"][0]
    assert row["exponential_tau"] > 0
    for added, mode in zip(row["added_damping"], content["modes"], strict=True):
        omega = 2 * np.pi * mode["frequency"]
        assert added == pytest.approx(1 / (row["exponential_tau"] * omega))
        assert mode["damping"] == pytest.approx(DAMPING, rel=0.02)


def test_densities_are_those_of_the_estimates(result, tests):
    for number, test in enumerate(tests, start=1):
        own, shown = test.hits.densities, result.arrays[f"hits_{number}_freq_hz"]
        assert shown[0] > 0
        assert shown[-1] <= test.hits.usable_limit_hz
        rows = np.searchsorted(own.freq_hz, shown)
        np.testing.assert_array_equal(own.freq_hz[rows], shown)
        force, motion = (result.arrays[f"hits_{number}_{name}"] for name in ("force", "motion"))
        np.testing.assert_allclose(force, own.force[rows], rtol=1e-6)
        np.testing.assert_allclose(motion, own.motion[rows], rtol=1e-6)
        noise = result.arrays[f"hits_{number}_noise_motion"]
        # White noise of 2e-3 m/s^2 up to 500 Hz.
        assert np.sqrt((noise**2).mean()) == pytest.approx(2e-3 / np.sqrt(500), rel=0.1)


def test_many_lines_share_a_density_without_losing_power():
    values = np.random.default_rng(1).random((2003, 2))
    grouped = _average_neighbours(values, 3)
    assert grouped.shape == (668, 2)
    counts = np.append(np.full(667, 3), 2)
    np.testing.assert_allclose((grouped * counts[:, None]).sum(axis=0), values.sum(axis=0))
    np.testing.assert_allclose(grouped[-1], values[-2:].mean(axis=0))


def test_report_makes_the_page_with_its_hits_again(folder, text, tmp_path):
    outcome = RUNNER.invoke(app, ["report", str(folder), "--out", str(tmp_path / "again.html")])
    assert outcome.exit_code == 0, outcome.stderr
    assert (tmp_path / "again.html").read_text("utf-8") == text
    assert "<h2>Hits</h2>" in text


def test_a_result_without_what_is_shown_beside_frfs_is_refused(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "old")
    with np.load(folder / "modes.npz") as file:
        arrays = {name: file[name] for name in file.files if name != "as_solid"}
    np.savez(tmp_path / "old" / "modes.npz", **arrays)
    outcome = RUNNER.invoke(app, ["report", str(tmp_path / "old")])
    assert outcome.exit_code == 3
    assert "identify the campaign again" in outcome.stderr


def test_the_page_holds_densities_channel_by_channel(text, result):
    for number, row in enumerate(data_of(text)["hits"], start=1):
        for key, name in (("densities", ""), ("noise", "noise_")):
            motion = result.arrays[f"hits_{number}_{name}motion"]
            np.testing.assert_array_equal(
                unpacked(row[key]["motion"]).reshape(motion.T.shape), motion.T
            )


def test_the_table_lists_hits_windows_and_rejected_hits(found, content):
    assert found["faults"] == []
    first, gone, second = found["rows"]
    cells = dict(zip(found["heads"], first, strict=True))
    assert (cells["force at"], cells["hits"], cells["averaged"]) == ("acc3:+tx", "6", "5")
    assert re.fullmatch(r"\d+ \.\. \d+ N", cells["peaks"])
    assert cells["estimator"] == "H1"
    most = max(100 * added for added in content["hits"][0]["added_damping"])
    assert float(cells["added to ζ / %"].removeprefix("≤ ")) == pytest.approx(most, rel=0.05)
    assert gone[0].startswith("left out: hit 3 at 4.3 s of record 1: weak: ")
    assert second[:3] == ["acc3:-ty", "6", "6"]


def test_densities_are_drawn_in_their_units(found, result):
    assert found["names"] == [
        "noise before the hits", "force acc3:+tx", "noise before the hits", "motion acc1:+tx",
    ]  # fmt: skip
    assert found["titles"][0].startswith("frequency / Hz")
    assert found["titles"][1:] == ["force / (N/√Hz)", "acceleration / (m/s²/√Hz)"]
    for (force, motion), number, channel in ((found["first"], 1, 0), (found["second"], 2, 8)):
        np.testing.assert_allclose(force, result.arrays[f"hits_{number}_force"], rtol=1e-6)
        own = result.arrays[f"hits_{number}_motion"][:, channel]
        np.testing.assert_allclose(motion, own, rtol=1e-6)


def test_a_click_on_a_reference_chooses_it(found):
    assert found["chosen"] == ["1", "8"]


def test_coherence_of_records_is_under_their_frfs(found, result):
    assert result.arrays["has_coherence"].all()
    np.testing.assert_allclose(found["coherence"], result.arrays["coherence"][:, 0, 0], rtol=1e-6)


def test_force_and_motion_are_shown_in_time_with_their_hits(found, content, result):
    second = content["hits"][1]
    (force, time, pushes), (motion, _, moves) = found["record"]
    assert [force, motion] == ["force acc3:-ty", "acceleration acc3:+tz"]
    np.testing.assert_allclose(pushes, result.arrays["hits_2_record_force"], rtol=1e-6)
    np.testing.assert_allclose(moves, result.arrays["hits_2_record_motion"][:, 8], rtol=1e-6)
    assert time[-1] == pytest.approx(8.0, abs=0.01)
    number = int(result.arrays["hits_2_record_number"])
    expected = [hit["time"] for hit in second["kept"] if hit["record"] == number]
    np.testing.assert_allclose(found["marks"], expected)
    _, block_time, block_force = found["block"][0]
    assert block_time[-1] - block_time[0] == pytest.approx(second["block"], rel=0.01)
    assert max(block_force) == pytest.approx(abs(second["kept"][0]["peak"]), rel=0.05)


def test_both_densities_stand_in_one_axis_over_their_largest_values(found, result):
    (motion, freq, moves), (force, _, pushes) = found["normalised"]
    assert [motion, force] == ["motion acc3:+tz", "force acc3:-ty"]
    np.testing.assert_allclose(freq, result.arrays["hits_2_freq_hz"], rtol=1e-6)
    for shown, density in (
        (moves, result.arrays["hits_2_motion"][:, 8]),
        (pushes, result.arrays["hits_2_force"]),
    ):
        assert max(shown) == 1
        np.testing.assert_allclose(shown, density / density.max(), rtol=1e-5)
