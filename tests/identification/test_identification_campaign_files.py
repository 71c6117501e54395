"""Campaigns from the files on disk: the demo, and one of another make."""

import struct
from pathlib import Path

import numpy as np
import pytest

from identification import (
    correct_layout,
    read_campaign,
    read_settings,
)
from identification.readers.campaign_toml import find_campaign_file
from identification.words import InputError
from mbmodel import load_machine

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "assets" / "demo"
OPEN = Path(__file__).resolve().parents[3] / "shared" / "campaigns" / "open"


@pytest.fixture(scope="module")
def demo():
    path, settings = read_settings(DEMO)
    layout = load_machine(path.parent / settings.model).layout
    return read_campaign(path, settings, correct_layout(path, settings, layout))


def test_the_demo_has_three_hammer_directions_at_node_eleven(demo):
    assert demo.name == "demo"
    references = [str(test.condition.reference) for test in demo.tests]
    assert [label[-3:] for label in references] == ["+tx", "+ty", "+tz"]
    assert len({label[:-4] for label in references}) == 1
    assert references[0][:-4].endswith("11")
    assert {test.condition.level_n for test in demo.tests} == {200.0}


def test_the_demo_has_69_channels_each_node_three(demo):
    expected = [f"acc{node}:+t{axis}" for node in range(1, 24) for axis in "xyz"]
    for test in demo.tests:
        assert [str(dof) for dof in test.estimate.frf.outputs] == expected


def test_the_demo_has_801_lines_to_200_hz(demo):
    np.testing.assert_allclose(demo.freq_hz, np.arange(801) / 4, rtol=1e-12)


def test_the_variance_of_the_demo_is_known_everywhere_but_at_rest(demo):
    for test in demo.tests:
        assert test.estimate.variance_source == "coherence"
        assert test.estimate.measured.all()
        assert (test.estimate.variance[1:] > 0).all()


def test_the_first_channel_of_the_demo_is_the_first_record_of_its_file(demo):
    content = (DEMO / "impact_200N.uff").read_bytes()
    start = content.index(b"    58b") - 1
    for _ in range(13):
        start = content.index(b"\n", start) + 1
    data = np.array(struct.unpack("<1602f", content[start : start + 6408]))
    np.testing.assert_array_equal(
        demo.tests[0].estimate.frf.values[:, 0, 0], data[::2] + 1j * data[1::2]
    )


@pytest.mark.skipif(not OPEN.is_dir(), reason="no shared/campaigns/open beside the repository")
def test_an_open_campaign_is_read_on_its_own_machine():
    folder = sorted(OPEN.glob("*/campaign.toml"))[0].parent
    path, settings = read_settings(folder)
    layout = load_machine(path.parent / settings.model).layout
    campaign = read_campaign(path, settings, correct_layout(path, settings, layout))
    assert len(campaign.tests) >= 3
    for test in campaign.tests:
        assert (test.estimate.variance[1:] > 0).all()


def test_a_file_in_place_of_the_folder_is_refused_as_such(tmp_path):
    model = tmp_path / "model.xml"
    model.write_text("<mujoco/>", encoding="utf-8")
    with pytest.raises(InputError, match="is a file: a campaign is a folder"):
        find_campaign_file(model)
