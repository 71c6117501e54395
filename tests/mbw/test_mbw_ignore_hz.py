"""``ignore_hz``: lines with mains hum are left out of identification and of tuning alike."""

import json
import shutil

import numpy as np
import pytest
import scipy.io
from campaign_folder import write_folder

from identification.modal import identify
from tests.helpers.command import invoke as mbw
from tuning import open_campaign

HUM_HZ = 50.0
IGNORE = "ignore_hz = [[49.5, 50.5]]\n"


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("small") / "clean", lines=321)


@pytest.fixture(scope="module")
def humming(clean):
    """The campaign with hum in every channel, which the coherence does not show."""
    folder = clean.parent / "humming"
    shutil.copytree(clean, folder)
    content = scipy.io.loadmat(folder / "impact.mat")
    frfs = content["FRFs"].copy()
    near = np.abs(content["freqs"].ravel() - HUM_HZ) < 0.6
    rng = np.random.default_rng(5)
    size = 3 * np.sqrt((np.abs(frfs) ** 2).mean(axis=2, keepdims=True))
    hum = rng.normal(size=(2, *frfs.shape[:2], near.sum()))
    frfs[:, :, near] += size * (hum[0] + 1j * hum[1])
    arrays = {"FRFs": frfs, "COHs": content["COHs"], "freqs": content["freqs"]}
    scipy.io.savemat(folder / "impact.mat", arrays)
    return folder


def with_key(folder, *, in_test=False, text=IGNORE):
    """A copy of a campaign with the key at top level, or in its [[test]]."""
    copy = folder.parent / f"{folder.name}{'-test' if in_test else '-top'}"
    shutil.copytree(folder, copy, dirs_exist_ok=True)
    path = copy / "campaign.toml"
    before = (folder / "campaign.toml").read_text("utf-8")
    path.write_text(before + text if in_test else text + before, "utf-8")
    return copy


@pytest.mark.parametrize("in_test", [False, True])
def test_the_lines_are_gone_from_the_campaign_and_a_remark_says_so(humming, in_test):
    campaign = open_campaign(with_key(humming, in_test=in_test))[2]
    assert len(campaign.freq_hz) == len(open_campaign(humming)[2].freq_hz) - 3
    assert not ((campaign.freq_hz > 49.4) & (campaign.freq_hz < 50.6)).any()
    (remark,) = [remark for remark in campaign.remarks if "ignore_hz" in remark]
    assert "3 of 321 frequency lines" in remark


def modes_of(folder):
    model, identified, _ = identify(open_campaign(folder)[2])
    inside = identified.inside.sum()
    return model.freq_hz[:inside], model.damping[:inside], identified.misfit


def test_modes_are_those_without_hum(clean, humming):
    expected = modes_of(clean)
    found = modes_of(with_key(humming))
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-3)
    np.testing.assert_allclose(found[1], expected[1], rtol=0.05)
    assert found[2] < 1.2
    assert modes_of(humming)[2] > 10


def tuned(folder, out):
    result = mbw("tune", folder, "--out", out, "--no-pictures", "-q", "--json", "-")
    return json.loads(result.stdout)["gap"]["sensors"]


def test_a_tuning_fits_all_but_the_hum(humming, tmp_path):
    assert tuned(humming, tmp_path / "with")["tuned"]["excess"] > 3
    ignored = tuned(with_key(humming), tmp_path / "without")
    assert ignored["tuned"]["excess"] < 1.2
    assert ignored["held_out"]["excess"] < 1.2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("ignore_hz = [[50.5, 49.5]]\n", "lower frequency first"),
        ("ignore_hz = [[-1.0, 2.0]]\n", "lower frequency first"),
        ("ignore_hz = [[1.0]]\n", "ignore_hz.1"),
        ("ignore_hz = [49.5, 50.5]\n", "ignore_hz.1"),
        ('ignore_hz = "50"\n', "ignore_hz"),
        ("ignore_hz = [[0.0, 1e6]]\n", "ignore_hz leaves 0 of 321 lines"),
    ],
)
def test_bad_ranges_are_refused_in_a_sentence(clean, text, words):
    result = mbw("identify", with_key(clean, text=text), "--out", clean.parent / "none")
    assert result.exit_code == 3
    assert words in " ".join(result.stderr.split())


def test_a_range_without_lines_is_remarked(clean):
    campaign = open_campaign(with_key(clean, text="ignore_hz = [[300.0, 301.0]]\n"))[2]
    assert len(campaign.freq_hz) == len(open_campaign(clean)[2].freq_hz)
    assert "ignore_hz 300..301 Hz holds no frequency line" in campaign.remarks
