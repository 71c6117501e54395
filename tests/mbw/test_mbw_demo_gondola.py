"""``mbw demo gondola``, and the campaign that it reads."""

import sys
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from identification.impacts import read_impacts
from mbw.command import app
from mbw.demo import gondola
from mbw.match.schema import MatchFile
from mbw.match.verb import read_mass
from tests.helpers.virtual_gondola import strike

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
CAMPAIGN = ASSETS / "campaign"


@pytest.fixture(scope="module")
def answer():
    return tomllib.loads((CAMPAIGN / "answer.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shown")
    target = folder / "match.json"
    words = ["demo", "gondola", "--out", str(folder / "out"), "--json", str(target)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return MatchFile.model_validate_json(target.read_text()), done.output, folder / "out"


def gondola_dampings(row):
    """Dampings by half-power width and by circles at the channels of a mode, where there are."""
    channels = [hand.channel for hand in row.by_hand]
    circles = [one.damping for one in row.circles if one.channel in channels and one.damping]
    return [values for values in ([hand.damping for hand in row.by_hand], circles) if values]


def test_the_demo_matches_every_measured_mode_and_ends_with_its_page(shown, answer):
    found, output, folder = shown
    elastic = [mode for mode in answer["mode"] if "simulated" in mode]
    assert [row.simulated for row in found.modes] == [mode["simulated"] for mode in elastic]
    assert min(row.probability for row in found.modes) > 0.9
    for row, mode in zip(found.modes, elastic, strict=True):
        assert row.frequency == pytest.approx(mode["frequency"], abs=4 * row.frequency_sd + 2e-3)
        assert row.damping == pytest.approx(mode["damping"], rel=0.05)
        for dampings in gondola_dampings(row) if row.frequency < 85.0 else ():  # two overlap above
            assert np.median(dampings) == pytest.approx(mode["damping"], rel=0.15)
    assert sum(bool(row.by_hand) for row in found.modes) >= 6  # the others are not alone
    assert output.count(", right") == len(elastic)
    assert output.count("an inner frame") == len(answer["mode"]) - len(elastic)
    assert ", wrong" not in output
    assert output.rstrip().endswith((folder / "match.html").resolve().as_uri())
    assert (folder / "match.html").is_file()


def test_the_demo_states_a_mass_that_the_truth_has_and_the_model_has_not(shown, answer):
    found, output, _ = shown
    weighed, tolerance = read_mass(gondola._WEIGHED_KG)
    assert abs(answer["mass"] - weighed) < tolerance
    assert found.mass_check.agrees is False
    assert "correct its densities and added masses" in " ".join(output.split())


def test_a_wrong_pair_is_graded_as_wrong(shown, answer):
    found, _, _ = shown
    first = found.modes[0].model_copy(update={"simulated": 9})
    wrong = found.model_copy(update={"modes": [first, *found.modes[1:-1]]})
    lines = gondola.grade_match(wrong, answer)
    assert lines[0].endswith("simulated mode 9, wrong")
    assert sum("not measured" in line for line in lines) == 1 + sum(
        "simulated" not in mode for mode in answer["mode"]
    )


def test_the_campaign_is_small_and_asynchronous_with_21_channels_at_15_places():
    assert sum(file.stat().st_size for file in CAMPAIGN.iterdir()) < 2e6
    campaign = read_impacts(CAMPAIGN)
    assert len(campaign.layout.points) == 15
    for record in campaign.records:
        assert len(record.channels) == 21
        first = record.channels[0]
        for channel in record.channels[1:]:
            shared = np.isin(first.time, channel.time).mean()
            assert shared < 0.05  # stamps of its own
        rates = [(len(one.time) - 1) / np.ptp(one.time) for one in record.channels]
        assert rates == pytest.approx([1260.0] * 21, rel=2e-3)


def test_the_campaign_is_what_its_script_draws():
    sys.path.insert(0, str(ASSETS))
    try:
        script = import_module("make_campaign")
    finally:
        sys.path.remove(str(ASSETS))
    structure = script.read_structure(ASSETS / "truths.npz", script.STRUCTURE)
    drawn = strike(structure, script.TRIAL, "stern1")
    with np.load(CAMPAIGN / "stern1.npz") as kept:
        for name, (time, value) in drawn.items():
            np.testing.assert_allclose(kept[f"time_{name}"], time, atol=script.TRIAL.tick)
            np.testing.assert_allclose(kept[f"value_{name}"], value, atol=script.TRIAL.step)
    assert script.sites_table(structure) == (CAMPAIGN / "sites.csv").read_text("utf-8")
    mass = tomllib.loads((CAMPAIGN / "answer.toml").read_text("utf-8"))["mass"]
    assert script.answer(structure, mass) == (CAMPAIGN / "answer.toml").read_text("utf-8")
