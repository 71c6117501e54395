"""A measured beam: ``case1`` and ``case2`` of the package ``vibrationtesting`` (Slater).

Two FRFs of one flexible structure with their coherence, and the last block of each in time. Which
channel is which is not documented beyond that; that ``case1`` behaves as a drive point (the power
of the hammer is positive on every line above the noise) and ``case2`` does not, the data say.
"""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from identification import (
    band_lines,
    check_bodies,
    correct_layout,
    read_campaign,
    read_layout,
    read_settings,
)
from identification.modal import identify
from identification.words import InputError

LAYOUT = """\
[body.beam]
[site.acc1]
position = [0.0, 0.0, 0.0]
[site.acc2]
position = [0.3, 0.0, 0.0]
"""
TEST = '[[test]]\nfile = "{0}.mat"\naverages = 10\nchannels = ["{1}:+z"]\nreferences = ["1:+z"]\n'


def channel_remarks_of(campaign):
    """Remarks on channels; five values of the coherence of case1 reach 1.25."""
    return [text for text in campaign.remarks if "coherence lies outside" not in text]


@pytest.fixture(scope="module")
def measured():
    package = find_spec("vibrationtesting")
    assert package is not None, "the test extra installs it"
    assert package.submodule_search_locations is not None
    folder = Path(package.submodule_search_locations[0]) / "data"
    return {name: scipy.io.loadmat(folder / f"{name}.mat") for name in ("case1", "case2")}


@pytest.fixture
def opened(measured, tmp_path):
    def build(nodes=(("case1", 1), ("case2", 2)), factors=None):
        (tmp_path / "layout.toml").write_text(LAYOUT)
        tests = "".join(TEST.format(name, node) for name, node in nodes)
        (tmp_path / "campaign.toml").write_text('layout = "layout.toml"\n' + tests)
        for name, content in measured.items():
            values = {
                "FRFs": (factors or {}).get(name, 1.0) * content["Hf_chan_2"].reshape(1, 1, -1),
                "COHs": content["Hf_coh_chan_2"].reshape(1, 1, -1),
                "freqs": content["Freq_domain"].ravel(),
            }
            scipy.io.savemat(tmp_path / f"{name}.mat", values)
        return read(tmp_path)

    return build


def read(folder):
    source, settings = read_settings(folder)
    layout = correct_layout(source, settings, read_layout(folder / settings.layout))
    return read_campaign(source, settings, layout)


def test_its_clearest_mode_is_where_a_circle_fit_of_others_has_it(opened) -> None:
    campaign = opened()
    model, found, _ = identify(campaign.select_lines(band_lines(campaign, (20.0, 300.0))))
    freq = model.freq_hz[: found.inside.sum()]
    # The package's own circle fit of case1, as its documentation prints it: 212.0925 Hz.
    assert np.abs(freq - 212.0925).min() < 0.05


def test_a_flexible_structure_is_not_accepted_as_a_solid(opened) -> None:
    campaign = opened()
    (check,) = check_bodies(campaign.select_lines(band_lines(campaign, (20.0, 300.0))))
    assert check.solid_to_hz is None
    assert "no check is possible" in check.sentence


def test_sound_channels_are_not_spoken_of(opened) -> None:
    assert channel_remarks_of(opened()) == []


def test_coherences_above_one_are_named_and_count_as_unknown(opened):
    (remark,) = [text for text in opened().remarks if "coherence" in text]
    assert remark.startswith("case1.mat: its coherence lies outside 0 to 1 in 5 values")


def test_a_dead_channel_is_named(opened) -> None:
    (remark,) = channel_remarks_of(opened(factors={"case2": 0.0}))
    assert "acc2:+tz is dead" in remark


def test_exchanged_channels_are_named(opened) -> None:
    (remark,) = channel_remarks_of(opened(nodes=(("case1", 2), ("case2", 1))))
    assert "drive point acc1:+tz" in remark
    assert "acc2:+tz behaves as a drive point does: were the two exchanged?" in remark


def test_time_records_with_force_and_motion_exchanged_are_refused(measured, tmp_path) -> None:
    content = measured["case2"]
    (tmp_path / "layout.toml").write_text(LAYOUT)
    (tmp_path / "campaign.toml").write_text(
        'layout = "layout.toml"\n' + TEST.format("time", 1).replace("averages = 10\n", "")
    )
    force, motion = content["Time_chan_2"].ravel(), content["Time_chan_1"].ravel()
    records = {"force": force[None], "response": motion[None, None], "rate_hz": 1280.0}
    scipy.io.savemat(tmp_path / "time.mat", records)
    with pytest.raises(InputError, match="check which channel is the force"):
        read(tmp_path)
