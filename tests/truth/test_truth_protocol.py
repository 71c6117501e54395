"""How campaigns are measured: variants come, independent of one another, and files hold them."""

import tomllib

import numpy as np
import pytest

from truth.campaign.draw import NO_TOLERANCE, draw_basis, draw_hammers, draw_rigid
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.measure import hammer_tests
from truth.campaign.protocol import Protocol, draw_protocol, occasions, takes
from truth.campaign.virtual_test import Plan, draw_campaign


@pytest.fixture(scope="module")
def drawn(nominal):
    return [draw_protocol(nominal, seed) for seed in range(400)]


VARIANTS = {
    "second hammer point": lambda one: len(one.nodes) == 2,
    "set-ups": lambda one: one.setups > 1,
    "three levels": lambda one: len(set(one.levels)) == 3,
    "no coherence": lambda one: not one.coherence,
    "dead channel": lambda one: one.dead is not None,
}


def test_every_variant_comes_in_about_one_of_six(drawn):
    for name, has in VARIANTS.items():
        share = np.mean([has(one) for one in drawn])
        assert 1 / 6 - 0.075 < share < 1 / 6 + 0.075, name  # four standard deviations
    grids = {(one.lines, one.resolution_hz) for one in drawn}
    assert len(grids) >= 4


def test_variants_do_not_hang_together(drawn):
    table = np.array([[has(one) for has in VARIANTS.values()] for one in drawn], float)
    correlation = np.corrcoef(table.T)
    assert np.abs(correlation - np.eye(len(VARIANTS))).max() < 0.2


def test_set_ups_share_the_sensors_out(nominal):
    files = takes(Protocol(setups=4, levels=(40.0, 200.0)), nominal, 3)
    assert len(files) == 8
    assert len({take.file for take in files}) == 8
    for level in (40.0, 200.0):
        channels = [one for take in files if take.level == level for one in take.channels]
        assert sorted(channels) == [(node, axis) for node in range(1, 24) for axis in (1, 2, 3)]
    assert {take.setup for take in files} == set("abcd")
    assert len(occasions(Protocol(), files)) == 24


def test_a_campaign_of_all_variants_says_what_it_is(two_bodies):
    protocol = Protocol(
        (1, 3),
        (40.0, 200.0),
        5,
        setups=3,
        lines=41,
        resolution_hz=1.0,
        coherence=False,
        dead=(2, 3),
    )
    campaign = draw_campaign(two_bodies, Plan(3, protocol=protocol))
    stated = tomllib.loads(campaign.files["campaign.toml"].decode())
    assert [test["file"] for test in stated["test"]] == [
        name for name in campaign.files if name.endswith(".uff")
    ]
    # Three sensors make one set-up: less than two sensors each is none.
    assert [test["level"] for test in stated["test"]] == [40.0, 200.0]
    assert b"coherence" not in campaign.files[stated["test"][0]["file"]]
    answer = tomllib.loads(campaign.answer.decode())
    assert answer["drawn"]["dead"] == [2, 3]
    assert answer["drawn"]["nodes"] == [1, 3]


def test_a_dead_channel_reads_its_noise_alone(two_bodies):
    machine = TrueMachine(two_bodies, draw_hammers(two_bodies, 1, NO_TOLERANCE, 1))
    protocol = Protocol((1,), lines=201, resolution_hz=1.0, dead=(2, 3))
    (take,) = takes(protocol, two_bodies, 1)
    (test,) = hammer_tests(machine, protocol, (take,), 1)
    median = np.median(test.coherence[20:], axis=(0, 2))
    row = take.channels.index((2, 3))
    assert median[row] < 0.2
    assert np.delete(median, row).min() > 0.3


def test_every_set_up_is_hit_anew(nominal):
    # The same linear machine, other hits and other noise in each file.
    station = draw_basis(nominal, 2)
    machine = TrueMachine(station, draw_hammers(station, 11, NO_TOLERANCE, 2))
    protocol = Protocol(levels=(200.0, 201.0), lines=101, resolution_hz=2.0)
    one, other = hammer_tests(machine, protocol, takes(protocol, station, 2), 2)
    off = np.abs(one.frf - other.frf)[10:]
    assert np.median(off / np.abs(one.frf[10:])) < 0.2
    assert (off > 0).all()


def test_rigid_directions_are_rigid_in_drawing_and_truth(nominal):
    basis = draw_rigid(nominal, 3, 5)
    gone = {joint.name for stage in nominal.stages for joint in stage.joints} - {
        joint.name for stage in basis.stages for joint in stage.joints
    }
    assert len(gone) == 3
    assert not any(name.startswith("granite_bottom") for name in gone)
    kept = [joint.name for stage in draw_rigid(nominal, 0, 5).stages for joint in stage.joints]
    assert kept == [joint.name for stage in nominal.stages for joint in stage.joints]
