"""Further tests of a machine: what they measure."""

import numpy as np
import pytest
from servo_campaign import write_servo_campaign

from mbw.blind.user_test import read_user_test
from truth import (
    Protocol,
    TruthError,
    find_further_test,
    list_further_tests,
)
from truth.campaign.further_tests import FORCE, HITS
from truth.machine.random_tree import draw_tree


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The campaign of the servo axis, in which nobody reads acc2 and acc6."""
    return read_user_test(write_servo_campaign(tmp_path_factory.mktemp("own")), None)


@pytest.fixture(scope="module")
def tree():
    return draw_tree(12, 2)


@pytest.fixture(scope="module")
def plain(tree):
    return Protocol((tree.first_aim(),), lines=161, resolution_hz=1.0)


def test_a_users_test_gets_every_point_that_is_not_hit_and_sensor_that_is_not_read(own):
    names = {test.name for test in list_further_tests(own.station, own.repeated.protocol)}
    points = {f"hammer point acc{node}" for node in (1, 3, 4, 5)}
    assert names == {*points, "sensor acc2", "sensor acc6", HITS, FORCE}


def test_a_further_hammer_point_is_hit_along_three_axes_with_the_noise_of_a_hit(own):
    protocol = own.repeated.protocol
    more = find_further_test(own.station, protocol, "hammer point acc3").protocol
    added = more.measured.tests[len(protocol.measured.tests) :]
    assert [test.reference for test in added] == [(3, 0), (3, 1), (3, 2)]
    assert [test.stated.reference for test in added] == [f"acc3:+t{axis}" for axis in "xyz"]
    hit = protocol.measured.tests[0].stated
    for test in added:
        assert test.stated.channels == hit.channels
        assert test.stated.level == hit.level
        np.testing.assert_array_equal(test.stated.deviation, hit.deviation)
    assert more.nodes == (*protocol.nodes, 3)


def test_a_further_sensor_reads_three_axes_in_every_test_with_the_median_noise(own):
    protocol = own.repeated.protocol
    more = find_further_test(own.station, protocol, "sensor acc2").protocol
    for old, new in zip(protocol.measured.tests, more.measured.tests, strict=True):
        assert new.channels == (*old.channels, (2, 1), (2, 2), (2, 3))
        assert new.stated.channels[-3:] == ("acc2:+tx", "acc2:+ty", "acc2:+tz")
        for column in new.stated.deviation.T[-3:]:
            np.testing.assert_array_equal(column, np.median(old.stated.deviation, axis=1))


def test_twice_the_hits_divide_the_noise_of_a_users_test_by_the_root_of_two(own):
    protocol = own.repeated.protocol
    for name, factor in ((HITS, np.sqrt(0.5)), (FORCE, 0.5)):
        more = find_further_test(own.station, protocol, name).protocol
        for old, new in zip(protocol.measured.tests, more.measured.tests, strict=True):
            np.testing.assert_allclose(new.stated.deviation, factor * old.stated.deviation)


def test_an_unknown_further_test_is_refused_with_those_that_exist(own):
    with pytest.raises(TruthError, match="no further test; there are hammer point acc1"):
        find_further_test(own.station, own.repeated.protocol, "hammer point acc99")


def test_a_virtual_test_reads_all_sensors_and_may_hit_elsewhere(tree, plain):
    names = [test.name for test in list_further_tests(tree, plain)]
    assert not any(name.startswith("sensor") for name in names)
    struck = len({sensor.node for _, sensor in tree.sensors()} - set(plain.nodes))
    assert sum(name.startswith("hammer point") for name in names) == struck
