"""What must change nothing in the check of solid bodies, and which channels count as measured."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from solid_bodies import HITS, Case, draw, only, part, triaxials

from identification import check_bodies
from identification.solid.body_channels import join_tests
from identification.words import Dof

LINES = 200


def fields(found) -> tuple:
    curves = (found.deviation, found.excess, found.reconstruction, found.expected)
    return curves, found.solid_to_hz, [(f.effect, f.location, f.dof) for f in found.faults]


def same(one, other, rtol=1e-6):
    (curves, *rest), (other_curves, *other_rest) = fields(one), fields(other)
    for a, b in zip(curves, other_curves, strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=1e-6)
    assert rest == other_rest


FLEXIBLE = Case(2000, lines=LINES, flex=(150.0, 0.1))


@cache
def flexible_check():
    return check_bodies(draw(FLEXIBLE))


def test_a_scale_of_the_force_changes_nothing():
    campaign = draw(FLEXIBLE)
    tests = []
    for test in campaign.tests:
        frf = replace(test.estimate.frf, values=test.estimate.frf.values * 1e3)
        estimate = replace(test.estimate, frf=frf, variance=test.estimate.variance * 1e6)
        tests.append(replace(test, estimate=estimate))
    same(*flexible_check(), *check_bodies(replace(campaign, tests=tuple(tests))))


def test_the_order_and_signs_of_channels_change_nothing():
    campaign = draw(FLEXIBLE)
    rng = np.random.default_rng(1)
    outputs = [campaign.tests[0].estimate.frf.outputs[k] for k in rng.permutation(12)]
    turned = [Dof.of(dof.point, dof.axis, int(rng.choice([-1, 1]))) for dof in outputs]
    tests = []
    for test in campaign.tests:
        new = part(test, outputs)
        frf = new.estimate.frf.select(turned, new.estimate.frf.inputs)
        tests.append(replace(new, estimate=replace(new.estimate, frf=frf)))
    same(*flexible_check(), *check_bodies(replace(campaign, tests=tuple(tests))))


def test_the_quantity_does_not_matter_but_for_the_weight_of_lines_within_a_window():
    campaign = draw(FLEXIBLE)
    tests = []
    for test in campaign.tests:
        frf = test.estimate.frf.as_quantity("receptance")
        factor = (2 * np.pi * campaign.freq_hz[:, None, None]) ** -4
        estimate = replace(test.estimate, frf=frf, variance=test.estimate.variance * factor)
        tests.append(replace(test, estimate=estimate))
    (one,) = flexible_check()
    (other,) = check_bodies(replace(campaign, tests=tuple(tests)))
    # A window spans 4 %, so receptance weighs its ends by up to 1.04^4 differently; noise is
    # smoothed over seven lines, which a factor of frequency bends.
    assert [f.effect for f in one.faults] == [f.effect for f in other.faults]
    assert other.solid_to_hz == pytest.approx(one.solid_to_hz, rel=0.02)


def test_set_ups_of_one_reference_are_used_together():
    # Two sensors at a time have one spare channel at most; together they are as one test.
    campaign = draw(FLEXIBLE)
    outputs = list(triaxials(campaign.layout))
    halves = tuple(
        part(test, half, name)
        for test in campaign.tests
        for half, name in ((outputs[:6], "a.uff"), (outputs[6:], "b.uff"))
    )
    same(*flexible_check(), *check_bodies(replace(campaign, tests=halves)))


def test_levels_stand_beside_one_another():
    campaign = draw(FLEXIBLE)
    tests = tuple(
        replace(test, condition=replace(test.condition, level_n=level))
        for level in (40.0, 200.0)
        for test in campaign.tests
    )
    (twice,) = check_bodies(replace(campaign, tests=tests))
    assert len(join_tests(replace(campaign, tests=tests)).values) == 2 * len(HITS)
    assert [fault.effect for fault in twice.faults] == ["flexible_body"]


def test_a_channel_missing_for_one_hit_is_no_hindrance():
    campaign = draw(Case(2100, lines=LINES))
    outputs = list(triaxials(campaign.layout))
    tests = (part(campaign.tests[0], outputs[:4] + outputs[5:]), *campaign.tests[1:])
    (found,) = check_bodies(replace(campaign, tests=tests))
    assert found.redundant == 6
    assert not found.faults
    assert found.solid_to_hz == found.freq_hz[-1]


def test_channels_that_read_zero_are_named_and_count_as_not_measured():
    """However few channels remain to contradict them."""
    for sensors, dead in ((4, slice(0, 1)), (4, slice(0, 3)), (2, slice(3, 6))):
        campaign = draw(Case(1904, sensors=sensors, lines=LINES))
        outputs = [dof for dof in campaign.outputs if isinstance(dof, Dof)]
        tests = []
        for test in campaign.tests:
            values = test.estimate.frf.values.copy()
            values[:, dead] = 0.0
            frf = replace(test.estimate.frf, values=values)
            tests.append(replace(test, estimate=replace(test.estimate, frf=frf)))
        (found,) = check_bodies(replace(campaign, tests=tuple(tests)))
        remaining = [dof for dof in outputs if dof not in outputs[dead]]
        (without,) = check_bodies(only(campaign, remaining))
        assert found.channels == without.channels
        named = [(f"sensor:{dof.point}", dof.direction[1:]) for dof in outputs[dead]]
        assert [(f.location, f.dof) for f in found.faults] == named
        assert {fault.effect for fault in found.faults} == {"dead_channel"}
        assert "no signal" in found.sentence
        np.testing.assert_allclose(found.deviation, without.deviation, rtol=1e-6, atol=1e-6)
