"""``mbw match``: a gondola's shapes and the campaign of another structure."""

import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from identification import read_layout
from mbw.command import app
from mbw.match.schema import MatchFile
from tests.helpers.virtual_gondola import Trial, read_structure, write_impacts

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
SHAPES = str(ASSETS / "shapes.vtu")
BAND = ("--band", 15, 40)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gondola") / "campaign"
    structure = read_structure(ASSETS / "truths.npz", 11)  # for development alone
    trial = Trial(71_701, seconds=6.0)
    write_impacts(folder, structure, trial, ("bow2", "bow3", "stern2"), ASSETS / "layout.toml")
    return folder


def match(out, *arguments):
    return CliRunner().invoke(app, ["match", *map(str, arguments), "--out", str(out)])


@pytest.fixture
def called(tmp_path):
    """The verb, its result in a folder of its own."""
    return partial(match, tmp_path / "matched")


@pytest.fixture(scope="module")
def narrow(campaign, tmp_path_factory):
    """What is matched in the lower band."""
    out = tmp_path_factory.mktemp("narrow") / "matched"
    return match(out, SHAPES, campaign, *BAND, "--json", "-", "--quiet").stdout


def test_a_campaign_is_matched_and_written(campaign, tmp_path, called):
    target = tmp_path / "match.json"
    done = called(SHAPES, campaign, "--mass", 264, "--json", target)
    assert done.exit_code == 0, done.output
    found = MatchFile.model_validate_json(target.read_text())
    assert [row.simulated for row in found.modes] == [7, 8, 9, 10, 11, 12, 13, 14]
    assert all(row.probability > 0.8 for row in found.modes[:6])
    assert found.mass == pytest.approx(264.1, rel=1e-3)
    assert len(found.channels) == 21
    assert len(found.impacts) == 3
    assert found.unmatched == []
    assert found.lines > 50
    hands = [hand for row in found.modes for hand in row.by_hand]
    assert len(hands) > 12
    apart = [abs(hand.maximum / hand.least_squares - 1) for hand in hands]
    assert np.median(apart) < 0.02  # table 3: 1.4 to 3.2 %
    assert sum(bool(row.by_hand) for row in found.modes) >= 6  # the others are not alone
    for row in [row for row in found.modes if row.by_hand]:
        widths = [hand.damping for hand in row.by_hand]
        assert np.median(widths) == pytest.approx(row.damping, rel=0.5)
        assert {hand.impact for hand in row.by_hand} <= set(found.impacts)
    lines = [line for line in done.stdout.splitlines() if line.strip()]
    assert lines[0].startswith("measured/Hz")
    assert len(lines) >= 7
    assert "shapes.vtu weighs 264.1 kg, within the stated 264 +- 13.2 kg" in done.output
    alone = called(SHAPES, campaign, "--mass", "264+-5%", "--json", "-", "--quiet")
    assert json.loads(alone.stdout) == json.loads(target.read_text())


def test_what_cannot_be_matched_is_refused_in_a_sentence(campaign, tmp_path, called):
    few = tmp_path / "few.txt"
    few.write_text("28.1\n50.2\n")
    unlike = called(SHAPES, campaign, "--frequencies", few)
    assert unlike.exit_code == 3
    assert "2 frequencies for the 20 shapes" in unlike.output
    none = called(SHAPES, tmp_path)
    assert none.exit_code == 3
    assert "a campaign is a folder with a campaign.toml" in none.output


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("band = [15.0, 95.0]", "band = [95.0, 15.0]", r"band = \[95, 15\] is not a band"),
        ("band = [15.0, 95.0]", "", "key band is missing"),
        ('layout = "layout.toml"', 'layout = "none.toml"', "does not exist"),
        ('file = "bow2.npz"', 'file = "bow9.npz"', "bow9.npz is not there"),
        ("band =", 'ignore = ["acc77_x"]\nband =', "acc77_x, which no record has"),
        ("band =", "colour = 3\nband =", "unknown key colour"),
        ("band =", "band = =", "TOML syntax"),
        ('file = "bow2.npz"', 'file = "bow3.npz"', "bow3.npz is listed twice"),
        ("band =", 'test = "bow2.npz"\nband =', "is a campaign of FRFs with a measured force"),
    ],
)
def test_a_campaign_that_is_wrong_is_named(campaign, tmp_path, old, new, said, called):
    text = (campaign / "campaign.toml").read_text()
    assert old in text
    done = called(SHAPES, copied(campaign, tmp_path, text.replace(old, new, 1)))
    assert done.exit_code == 3
    assert re.search(said, done.output.replace("\n", " ")), done.output


def copied(campaign, target, text):
    for file in campaign.iterdir():
        (target / file.name).symlink_to(file)
    (target / "campaign.toml").unlink()
    (target / "campaign.toml").write_text(text)
    return target


def test_a_campaign_without_channels_is_named(campaign, tmp_path, called):
    text = (campaign / "campaign.toml").read_text()
    with np.load(campaign / "bow2.npz") as file:
        names = [name.removeprefix("time_") for name in file if name.startswith("time_")]
    done = called(SHAPES, copied(campaign, tmp_path, f"ignore = {json.dumps(names)}\n{text}"))
    assert done.exit_code == 3
    assert "ignore leaves no channel" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("mass", "agrees"), [("800+-40", False), ("240+-30", True), ("240+-10%", False)]
)
def test_another_mass_is_a_remark_and_the_match_stays(
    campaign, narrow, tmp_path, called, mass, agrees
):
    plain = json.loads(narrow)
    done = called(SHAPES, campaign, *BAND, "--mass", mass, "--json", tmp_path / "match.json")
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "match.json").read_text())
    check = found.pop("mass_check")
    assert plain.pop("mass_check") is None
    assert found == plain
    assert check["agrees"] is agrees
    page = (tmp_path / "matched" / "match.html").read_text("utf-8")
    output = " ".join(done.output.split())
    assert ("correct its densities and added masses" in output) is not agrees
    assert ('class="warn"' in page) is not agrees
    if mass == "800+-40":  # sqrt(264.1 / 800) - 1
        assert "would change its frequencies by -42.5 %" in output


def test_a_mass_in_another_form_is_a_usage_error(campaign, called):
    for mass in ("heavy", "800+-", "800+-light", "800 40"):
        done = called(SHAPES, campaign, "--mass", mass)
        assert done.exit_code == 2, mass
        assert "as 800 or 800+-40" in " ".join(done.output.split())


@pytest.mark.parametrize("mass", ["0", "-3", "inf", "nan"])
def test_a_mass_that_is_none_is_refused(campaign, called, mass):
    done = called(SHAPES, campaign, "--mass", mass)
    assert done.exit_code == 3
    assert "is no mass" in done.output


def test_a_campaign_of_frfs_is_distinguished_from_one_of_impacts(campaign, called):
    done = called(SHAPES, ASSETS.parent / "demo")
    assert done.exit_code == 3
    assert "a match needs impacts whose force is not measured" in " ".join(done.output.split())
    done = CliRunner().invoke(app, ["identify", str(campaign)])
    assert done.exit_code == 3
    assert "mbw match reads" in " ".join(done.output.split())


def test_nearest_node_and_averaging_width_are_options(campaign, tmp_path, called):
    layout = read_layout(campaign / "layout.toml")  # whose sites are nodes
    sites = zip(layout.points, np.add(layout.positions, [0.004, 0.003, 0.0]), strict=True)
    rows = "".join(f"{name},{x},{y},{z},xyz\n" for name, (x, y, z) in sites)
    text = (campaign / "campaign.toml").read_text().replace("layout.toml", "places.csv")
    own = copied(campaign, tmp_path, text)
    (own / "places.csv").write_text(f"site,x,y,z,axes\n{rows}")
    done = called(SHAPES, own, "--nearest", "--width", 1.5)
    assert done.exit_code == 0, done.output
    with np.load(tmp_path / "matched" / "match.npz") as file:
        near, wide = file["at"], file["amplitude"]
        readings = file["closeness"], file["closeness_largest"]
    assert readings[0].shape == readings[1].shape
    assert not np.allclose(*readings)
    assert called(SHAPES, own).exit_code == 0
    with np.load(tmp_path / "matched" / "match.npz") as file:
        plain, narrow = file["at"], file["amplitude"]
    assert np.abs(near - plain).max() > 1e-6
    assert near == pytest.approx(plain, abs=0.2 * np.abs(plain).max())
    assert np.abs(np.diff(wide, axis=0)).max() < np.abs(np.diff(narrow, axis=0)).max()


def test_a_channel_that_is_ignored_is_not_matched(campaign, tmp_path, called):
    text = 'ignore = ["acc3_z", "acc1_y"]\n' + (campaign / "campaign.toml").read_text()
    done = called(SHAPES, copied(campaign, tmp_path, text), "--json", "-", "--quiet")
    found = MatchFile.model_validate_json(done.stdout)
    assert len(found.channels) == 19
    matched = [row.simulated for row in found.modes if row.simulated is not None]
    assert matched == [7, 8, 9, 10, 11, 12, 13, 14]


def test_a_band_of_the_user_replaces_that_of_the_campaign(campaign, narrow, called):
    done = called(SHAPES, campaign, *BAND, "--json", "-", "--quiet", "--jobs", 2)
    assert (done.exit_code, done.stderr, done.stdout) == (0, "", narrow)
    found = MatchFile.model_validate_json(done.stdout)
    assert found.modes
    assert all(15 < row.frequency < 40 for row in found.modes)
    silent = called(SHAPES, campaign, *BAND, "-q")
    assert (silent.exit_code, silent.output) == (0, "")
    assert called(SHAPES, campaign, "--band", 40, 15).exit_code == 2
