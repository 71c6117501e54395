"""Hammer tips side by side: ``mbw identify CAMPAIGN --compare OTHER``."""

import json

import numpy as np
import pytest
import scipy.signal
from browser import CHROMIUM, browse
from campaign_folder import write_folder
from hammer_records import Hammer, System, channel_functions, strike
from small_machine import MJCF
from typer.testing import CliRunner

from identification.hits.tips import HammerTip, campaign_tips, strongest_tips, tip_sentence
from identification.words import Dof
from mbmodel import as_drawn, load_machine, model_modes, shapes_at
from mbw.command import app
from tuning import open_campaign

RUNNER = CliRunner()
SOFT_S, HARD_S, RATE_HZ = 0.010, 0.003, 2000.0  # duration of the pulses, sampling rate
NODES = tuple(f"{node}:+{axis}" for node in range(1, 7) for axis in "xyz")


def write_tip(folder, pulse_s, seed):
    """Hits of one tip at one reference; both tips reach 200 N, the sensors have noise."""
    folder.mkdir(parents=True)
    (folder / "model.xml").write_text(MJCF, encoding="utf-8")
    (folder / "campaign.toml").write_text(
        'model = "model.xml"\n[[test]]\nfile = "hits.uff"\n', encoding="utf-8"
    )
    model = as_drawn(load_machine(folder / "model.xml"))
    modes = model_modes(model, model.drawn)
    kept = modes.poles.imag > 0
    outputs = tuple(Dof.of(f"acc{node}", axis) for node in range(1, 7) for axis in range(3))
    shapes = shapes_at(model, model.drawn, modes, outputs)[:, kept]
    turn = shapes[np.abs(shapes).argmax(axis=0), np.arange(kept.sum())]
    real = np.real(shapes * np.abs(turn) / turn)
    damping = np.full(kept.sum(), 0.02)
    system = System(modes.freq_hz[kept], damping, real, real[6] + real[7] + real[8])
    hammer = Hammer(
        rate_hz=RATE_HZ, duration_s=4.0, pulse_s=pulse_s, noise=1e-2, force_noise=0.05, seed=seed,
        times_s=((0.3, 2.2),) * 3, peaks_n=((200.0, 200.0),) * 3,
        outputs=NODES, reference="3:+x",
    )  # fmt: skip
    records = strike(system, hammer)
    functions = channel_functions(records, order="<")
    (folder / "hits.uff").write_bytes(b"".join(function.content() for function in functions))
    return records


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    place = tmp_path_factory.mktemp("tips")
    records = {
        "soft": write_tip(place / "soft", SOFT_S, 1),
        "hard": write_tip(place / "hard", HARD_S, 2),
    }
    outcome = RUNNER.invoke(
        app,
        ["identify", str(place / "soft"), "--compare", str(place / "hard"), "--out",
         str(place / "result")],
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.stderr
    return place / "result", records, " ".join(outcome.stderr.split())


@pytest.fixture(scope="module")
def content(compared):
    return json.loads((compared[0] / "tips.json").read_text("utf-8"))


def test_the_energy_is_that_of_welch_times_the_length_of_the_block(compared, content):
    """E = 2 |F|^2 with F = dt sum f exp(-i w t): the density of a block times its length."""
    for row in content["tips"]:
        records, spacing = compared[1][row["tip"]], row["frequency"][1] - row["frequency"][0]
        size = round(RATE_HZ / spacing)
        powers = []
        for force in records.force:
            for start in (0.28, 2.18):
                block = force[round(start * RATE_HZ) :][: round(0.1 * RATE_HZ)]
                padded = np.concatenate([block, np.zeros(size - len(block))])
                freq, power = scipy.signal.welch(
                    padded, RATE_HZ, window="boxcar", nperseg=size, detrend=False
                )
                powers.append(power * size / RATE_HZ)
        expected = np.interp(row["frequency"], freq, np.mean(powers, axis=0))
        strong = np.array(row["energy"]) > 1e-3 * max(row["energy"])
        np.testing.assert_allclose(np.array(row["energy"])[strong], expected[strong], rtol=0.05)


def test_each_tip_ends_where_its_pulse_has_lost_20_db(content):
    """A half sine of length T has |F| ~ cos(pi f T) / (1 - (2 f T)^2): -20 dB at f T = 1.23."""
    for row, length in zip(content["tips"], (SOFT_S, HARD_S), strict=True):
        f_t = np.linspace(0.0, 1.45, 1451) + 1e-6
        size = np.abs(np.cos(np.pi * f_t) / (1 - (2 * f_t) ** 2))
        limit = f_t[size >= 0.1].max() / length
        assert row["force_limit"] == pytest.approx(limit, rel=0.08)
        low, high = row["band"]
        inside = (np.array(row["frequency"]) >= low) & (np.array(row["frequency"]) <= high)
        assert np.array(row["coherence"])[inside][[0, -1]].min() > 0.9
        assert high <= row["force_limit"]


def test_the_softer_tip_has_the_most_energy_below_and_the_harder_above(compared, content):
    first, *_, last = content["strongest"]
    assert (first["tip"], last["tip"]) == ("soft", "hard")
    # E(0) is (2 A T / pi)^2: the ratio of the lengths squared.
    assert 0 < first["gain_db"] <= 20 * np.log10(SOFT_S / HARD_S)
    assert first["band"][1] < last["band"][0]
    for text in content["sentences"]:
        assert text in compared[2]
    assert content["sentences"][0].startswith("soft: its force stays within 20 dB of its largest")
    assert content["sentences"][-1].startswith("Most energy comes from soft from ")


def test_hammers_that_a_campaign_names_are_tips_of_their_own(compared, tmp_path):
    both = tmp_path / "both"
    both.mkdir()
    (both / "model.xml").write_text(MJCF, encoding="utf-8")
    text = 'model = "model.xml"\n'
    for name in ("soft", "hard"):
        source = compared[0].parent / name / "hits.uff"
        (both / f"{name}.uff").write_bytes(source.read_bytes())
        text += f'[[test]]\nfile = "{name}.uff"\nhammer = "{name}"\n'
    (both / "campaign.toml").write_text(text, encoding="utf-8")
    tips = {tip.name: tip for tip in campaign_tips(open_campaign(both, None)[2])}
    assert set(tips) == {"both: soft", "both: hard"}
    assert 2 * tips["both: soft"].force_limit_hz < tips["both: hard"].force_limit_hz
    assert [tip.hits for tip in tips.values()] == [6, 6]


def test_a_tip_serves_the_lines_with_force_and_coherence():
    freq = np.linspace(1, 100, 100)
    low = HammerTip("low", 5, freq, 10.0 ** (-freq / 10.01), np.where(freq < 30, 0.95, 0.5), 90.0)
    high = HammerTip("high", 5, freq, np.full(100, 1e-3), np.full(100, 0.92), 80.0)
    assert low.force_limit_hz == 21.0
    assert low.band_hz == (1.0, 21.0)
    parts = strongest_tips([low, high])
    assert [part.name for part in parts] == ["low", "high"]
    assert parts[0].high_hz == pytest.approx(30, abs=3)
    assert "it excites 1 to 21 Hz with a median coherence above 0.9" in tip_sentence(low)
    assert strongest_tips([low]) == ()


def test_files_of_frfs_are_compared_by_coherence_alone(tmp_path):
    first = write_folder(tmp_path / "first", lines=60)
    second = write_folder(tmp_path / "second", lines=60, noise=0.2, seed=2)
    outcome = RUNNER.invoke(
        app,
        ["identify", str(first), "--compare", str(second), "--out", str(tmp_path / "out"),
         "--no-pictures"],
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.stderr
    rows = json.loads((tmp_path / "out" / "tips.json").read_text("utf-8"))
    assert [row["energy"] for row in rows["tips"]] == [None, None]
    assert rows["strongest"] == []
    medians = [np.median(row["coherence"]) for row in rows["tips"]]
    assert medians[0] > medians[1]
    assert not (tmp_path / "out" / "tips.html").exists()
    same = RUNNER.invoke(app, ["identify", str(first), "--compare", str(first)])
    assert same.exit_code == 2
    assert "rename the folder of one" in " ".join(same.stderr.split())


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_page_draws_energy_and_coherence_of_each_tip(compared, content, tmp_path):
    probe = """<script>setTimeout(() => {
      const plot = byId("tips"), rows = [...document.querySelectorAll("#tips-table tbody tr")];
      const found = {faults: FAULTS, bars: plot.layout.shapes.length,
        names: plot.data.map(t => t.name + " " + t.yaxis),
        curves: plot.data.map(t => Array.from(t.y)),
        rows: rows.map(row => row.cells[0].textContent)};
      document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
    }, 1500);</script>"""
    page = (compared[0] / "tips.html").read_text("utf-8")
    found = browse(page, tmp_path, probe=probe)
    assert found["faults"] == []
    assert found["rows"] == ["soft", "hard"]
    assert found["names"] == ["soft y", "soft y", "soft y2", "hard y", "hard y", "hard y2"]
    assert found["bars"] == 1 + len(content["strongest"])
    np.testing.assert_allclose(found["curves"][0], content["tips"][0]["energy"], rtol=1e-5)
    np.testing.assert_allclose(found["curves"][5], content["tips"][1]["coherence"], rtol=1e-5)
