"""Further tests of a machine: what they measure, and what they show beyond the test as it is."""

import numpy as np
import pytest
from servo_campaign import write_servo_campaign

from mbw.blind.user_test import read_user_test
from truth import (
    Protocol,
    SmallestSize,
    Tolerances,
    TruthError,
    compare_sizes,
    find_further_test,
    find_signatures,
    linearise_test,
    list_further_tests,
    rank_gains,
)
from truth.campaign.further_tests import FORCE, HITS
from truth.effects import CATALOGUE
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


def row(effect, of_usual, location="body:a", *, is_found=True):
    value = None if of_usual is None else 10 * of_usual
    return SmallestSize(effect, location, "", "mass", value, of_usual, is_found, 1.0, ())


def gains(tree, protocol, names=("mass_error", "joint_coupling")):
    """The gain of each effect and place per square of its size, where no tolerance is bounded."""
    test = linearise_test(tree, protocol, Tolerances())
    signatures, _ = find_signatures(test, {name: CATALOGUE[name] for name in names}, [])
    return np.array([signature.left @ signature.left for signature in signatures])


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


def test_no_further_test_tells_less(tree, plain):
    """More data never lose information; twice the hits never gain more than a factor of two."""
    before = gains(tree, plain)
    for test in list_further_tests(tree, plain):
        after = gains(tree, test.protocol)
        assert (after > 0.98 * before).all(), test.name  # signatures of fewer lines, for more cells
        if test.name == HITS:
            assert (after < 2.02 * before).all()
            assert (after / before).max() > 1.3


def test_a_gain_counts_what_is_found_before_and_after():
    before = [row("a", 2.0), row("b", 0.5), row("c", None, is_found=False), row("d", 0.9)]
    after = [row("a", 0.8), row("b", 0.25), row("c", 0.6), row("e", 0.1)]
    gain = compare_sizes("more", before, after)
    assert (gain.findable_before, gain.findable, gain.compared) == (1, 3, 3)
    assert gain.shrink == pytest.approx(np.sqrt(0.4 * 0.5))
    assert gain.most.effect == "c"  # not found at all before
    assert gain.most_after.value == pytest.approx(6.0)


def test_tests_are_ranked_by_what_they_find_and_then_by_sizes():
    before = [row("a", 2.0), row("b", 0.5)]
    findable, small, large = (
        compare_sizes(name, before, after)
        for name, after in (
            ("found", [row("a", 0.9), row("b", 0.5)]),
            ("small", [row("a", 1.1), row("b", 0.1)]),
            ("large", [row("a", 1.9), row("b", 0.4)]),
        )
    )
    assert [gain.name for gain in rank_gains([large, small, findable])] == [
        "found",
        "small",
        "large",
    ]
