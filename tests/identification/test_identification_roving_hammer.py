"""A roving hammer's test turned round by reciprocity."""

from dataclasses import replace

import numpy as np
import pytest

from identification.roving_hammer import (
    exchange_hits_and_channels,
    is_roving_hammer,
    shape_points,
)
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

SITES = tuple(f"acc{k}" for k in range(1, 6))
LAYOUT = Layout(
    ("b",),
    np.zeros((1, 3)),
    SITES,
    np.zeros(5, int),
    np.eye(5)[:, :3],
    np.tile(np.eye(3), (5, 1, 1)),
)
SENSORS = (Dof("acc2", "+tx"), Dof("acc4", "-tz"))
HITS = tuple(Dof(site, "-tz") for site in SITES)


@pytest.fixture
def campaign():
    rng = np.random.default_rng(5)
    freq = np.arange(1.0, 8)
    tests = []
    for hit in HITS:
        values = rng.normal(size=(7, 2, 1)) + 1j * rng.normal(size=(7, 2, 1))
        frf = Frf(freq, values, SENSORS, (hit,), "mobility")
        known = np.ones((2, 1), bool)
        variance, coherence = rng.uniform(1, 2, (2, 7, 2, 1))
        estimate = FrfEstimate(frf, variance, "coherence", known, coherence / 2, 4)
        tests.append(Test(Condition("rove.uff", hit), estimate))
    return Campaign("c", LAYOUT, tuple(tests))


def test_every_value_is_found_again_with_its_ends_exchanged(campaign) -> None:
    turned = exchange_hits_and_channels(campaign)
    assert [test.condition.reference for test in turned.tests] == [d.positive for d in SENSORS]
    for column, test in enumerate(turned.tests):
        estimate = test.estimate
        assert estimate.frf.outputs == HITS
        for row, own in enumerate(campaign.tests):
            before = own.estimate
            sign = SENSORS[column].sign
            np.testing.assert_array_equal(
                estimate.frf.values[:, row, 0], sign * before.frf.values[:, column, 0]
            )
            np.testing.assert_array_equal(
                estimate.variance[:, row, 0], before.variance[:, column, 0]
            )
            np.testing.assert_array_equal(
                estimate.coherence[:, row, 0], before.coherence[:, column, 0]
            )


def test_turned_twice_it_is_the_same(campaign) -> None:
    twice = exchange_hits_and_channels(exchange_hits_and_channels(campaign))
    assert len(twice.tests) == len(campaign.tests)
    for one, other in zip(twice.tests, campaign.tests, strict=True):
        assert one.condition.reference == other.condition.reference.positive
        again = one.estimate.frf.select(SENSORS, (other.condition.reference,))
        np.testing.assert_array_equal(again.values, other.estimate.frf.values)


def test_a_point_hit_twice_counts_by_its_first_test(campaign) -> None:
    again = replace(campaign.tests[1], condition=replace(campaign.tests[1].condition, test="b"))
    turned = exchange_hits_and_channels(replace(campaign, tests=(*campaign.tests, again)))
    assert turned.tests[0].estimate.frf.outputs == HITS


def test_more_hits_than_channels_make_a_roving_hammer(campaign) -> None:
    assert is_roving_hammer(campaign)
    assert not is_roving_hammer(exchange_hits_and_channels(campaign))
    assert not is_roving_hammer(replace(campaign, tests=campaign.tests[:2]))


def test_shapes_are_known_where_the_hammer_roved_else_at_the_channels(campaign) -> None:
    assert shape_points(campaign) == tuple(dof.positive for dof in HITS)
    still = replace(campaign, tests=campaign.tests[:2])
    assert shape_points(still) == tuple(dof.positive for dof in SENSORS)
