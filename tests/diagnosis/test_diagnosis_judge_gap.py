"""What is a gap, and what is noise, or tolerances that lie beyond their bounds."""

import pytest

from diagnosis.inference.posterior import judge
from tests.helpers.judged import evidence, pair, refit


def test_what_is_left_counts_beyond_what_counts_as_nothing():
    # A delay that leaves 1.028 of a gap of 0.3 explains it: badly known noise leaves as much.
    gap, least = 0.3, 0.03
    found = [
        judge(evidence(gap, (refit("feedback_delay", "joint:b", 1e4 * (1 + left), left),)))
        for left in (least - 0.002, least + 0.1)
    ]
    assert [one.word for one in found] == ["explained", "unexplained"]


def test_one_tolerance_beyond_its_bound_is_no_effect_but_a_fault_is():
    wrong = (refit("mass_error", "body:a", 1.2e4, 0.2),)
    assert judge(evidence(0.25, wrong)).word == "unexplained"
    assert judge(evidence(0.25, wrong, loose=1.0, pull=3.2)).word == "none"
    assert judge(evidence(0.25, wrong, loose=1.0, pull=16.0)).word == "unexplained"


def test_tolerances_that_are_released_and_lie_no_farther_than_an_outlier_are_no_effect():
    # Another tolerance, or the same with all others free, may lie beyond: pull is 4.9.
    turned = refit("sensor_misalignment", "sensor:acc1", 1e4, 0.0)
    outlier, fault = (turned.model_copy(update={"off": off}) for off in (3.0, 5.0))
    assert judge(evidence(0.4, (outlier,), loose=0.98, pull=4.9)).word == "none"
    assert judge(evidence(0.4, (fault,), loose=0.98, pull=4.9)).word == "explained"
    # Nor is it a second effect, nor do both hide a gap that neither explains.
    right = refit("mass_error", "body:a", 1.2e4, 0.2)
    both = pair(right, turned, 1e4, 0.0)
    for off, word in ((3.0, "explained"), (6.0, "several")):
        two = both.model_copy(update={"off": (None, off)})
        found = judge(evidence(70.0, (right,), loose=60.0, pull=9.0, pairs=(two,)))
        assert found.word == word
        assert found.present[0] == right.key
    assert judge(evidence(70.0, (outlier.model_copy(update={"chi_square": 60.0}),))).word == (
        "unexplained"
    )


def test_what_outliers_of_tolerances_leave_beside_the_right_effect_is_no_gap():
    right = refit("mass_error", "body:a", 2e4, 1.0)
    assert judge(evidence(10.0, (right,))).word == "unexplained"
    eased = right.model_copy(update={"loose": 1.01, "pull": 3.4})
    assert judge(evidence(10.0, (eased,))).word == "explained"
    pulled = right.model_copy(update={"loose": 1.01, "pull": 12.0})
    assert judge(evidence(10.0, (pulled,))).word == "unexplained"
    # Nor is what they leave beside the right two.
    second = refit("appendage", "body:c", 2e4, 5.0)
    two = pair(refit("mass_error", "body:a", 4e4, 4.0), second, 1.5e4, 1.0)
    seen = right.model_copy(update={"cost": 4e4, "chi_square": 5.0}), second
    assert judge(evidence(10.0, seen, pairs=(two,))).word == "unexplained"
    eased = two.model_copy(update={"loose": 1.01, "pull": 4.3})
    assert judge(evidence(10.0, seen, pairs=(eased,))).word == "several"


def test_hits_that_met_different_machines_are_not_nothing():
    steady, moving = (
        judge(evidence(0.04).model_copy(update={"unsteady": tests})) for tests in (0, 2)
    )
    assert steady.word == "none"
    assert moving.word == "unexplained"
    # An aim that scatters leaves no gap beside what scatters.
    assert judge(evidence(0.0).model_copy(update={"unsteady": 9})).word == "none"
    # What one effect explains to the noise is believed as before.
    one = (refit("mass_error", "body:a", 1.02e4, 0.02),)
    both = [judge(evidence(0.9, one).model_copy(update={"unsteady": tests})) for tests in (0, 2)]
    assert both[0].causes == both[1].causes


def test_what_one_effect_gains_tells_a_gap_as_small_as_what_noise_may_hide():
    values = 40_000

    def seen(left, loose=None, pull=0.0, gap=0.05):
        one = refit("viscoelastic", "joint:b", values * (1 + left), left)
        made = evidence(gap, (one,), loose=loose, pull=pull)
        return judge(made.model_copy(update={"cost": values * (1 + gap)}))

    by_chance = seen(0.048)  # 80 nats of the best among a thousand hypotheses
    assert by_chance.word == "none"
    assert by_chance.none > 0.6
    for left in (0.0, -0.04):  # noise may be less than was thought
        told = seen(left)
        assert told.word == "explained"
        assert told.causes[0][0] == ("viscoelastic", "joint:b", None)
        assert told.causes[0][1] > 0.8
        assert told.none < 0.05
    # A part of it: something is there, but this is not all.
    half = seen(0.15, gap=0.3)
    assert half.word == "unexplained"
    # As little as badly known noise may leave is no part.
    assert seen(0.015, gap=0.3).word == "explained"
    # One tolerance of hundreds, free of its bound, gains as much: nothing is missing.
    assert seen(0.0, loose=1.0, pull=3.5).word == "none"
    assert seen(0.0, loose=1.0, pull=9.0).word == "explained"  # none of them is so far off


def test_what_lines_share_is_the_gap_whatever_the_noise_is():
    values = 40_000
    right, wrong = (
        refit(effect, place, values * (1 + left), left)
        for effect, place, left in (("appendage", "body:a", 0.03), ("gyroscopic", "body:a", 0.05))
    )
    unknown = evidence(0.09, (right, wrong)).model_copy(update={"cost": values * 1.09})

    def known(gap, *left):
        refits = tuple(
            one.model_copy(update={"serial": part})
            for one, part in zip(unknown.refits, left, strict=True)
        )
        return unknown.model_copy(update={"serial": gap, "loose": 1 + gap, "refits": refits})

    # All of it is noise that is larger than stated; or a gap that the first explains; or not.
    assert judge(known(0.002, 0.001, 0.001)).word == "none"
    there = judge(known(0.06, 0.002, 0.02))
    assert there.word == "explained"
    assert there.causes[0][0] == right.key
    assert judge(known(0.06, 0.04, 0.05)).word == "unexplained"
    # A noise that is smaller than stated hides no gap.
    quiet = [one.model_copy(update={"chi_square": one.chi_square - 0.1}) for one in (right, wrong)]
    hidden = known(0.06, 0.002, 0.02).model_copy(update={"chi_square": 0.99})
    found = judge(hidden.model_copy(update={"refits": tuple(quiet)}))
    assert found.word == "explained"


def test_a_gap_that_falls_between_lines_counts_by_the_variance():
    # Lines so far apart that neighbours share nothing of a mode.
    far = refit("appendage", "body:a", 1e5, 2.0).model_copy(update={"serial": 0.0})
    assert far.gap == pytest.approx(1.7)
    seen = evidence(9.0, (far,)).model_copy(update={"serial": 0.1})
    assert seen.gap == pytest.approx(8.7)
    assert not seen.is_noise
    assert seen.model_copy(update={"chi_square": 1.2, "serial": 0.004}).is_noise
    assert seen.model_copy(update={"chi_square": 1.02, "serial": None}).is_noise
    assert not seen.model_copy(update={"chi_square": 1.02, "serial": 0.02}).is_noise
