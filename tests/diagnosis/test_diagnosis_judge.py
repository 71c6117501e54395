"""From evidence to probabilities: what must hold of any evidence, and of plain ones."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as some

from diagnosis.evidence import Evidence, Paired, Pushed, Refitted, Scored
from diagnosis.judge import judge
from truth.grade.read_verdict import read_verdict

PLACES = ("body:a", "joint:b", "sensor:acc1")


def refit(effect, place, cost, left):
    return Refitted(effect=effect, location=place, dof=None, cost=cost, chi_square=1 + left)


def pair(first, second, cost, left):
    return Paired(keys=(first.key, second.key), cost=cost, chi_square=1 + left)


def evidence(gap, refits=(), proven=(), gains=(5.0, 3.0, 1.0), loose=None, pull=0.0, pairs=()):
    rows = [
        Scored(effect="mass_error", location=place, dof=None, gains=(gain, gain, gain))
        for place, gain in zip(PLACES, gains, strict=True)
    ]
    return Evidence(
        proven=proven,
        cost=1e4 * (1 + gap),
        chi_square=1 + gap,
        loose=1 + gap if loose is None else loose,
        pull=pull,
        refits=refits,
        pairs=pairs,
        scored=tuple(rows),
        pushed=tuple(
            Pushed(location=place, dof=None, gain=gain)
            for place, gain in zip(PLACES, gains, strict=True)
        ),
        variance="coherence",
    )


positive = some.floats(1e-4, 1e3)


@given(
    gap=positive,
    lefts=some.lists(positive, max_size=4),
    proven=some.integers(0, 2),
)
def test_probabilities_are_those_of_exclusive_hypotheses(gap, lefts, proven):
    refits = tuple(
        refit("mass_error", f"body:{k}", 1e4 * (1 + left), left) for k, left in enumerate(lefts)
    )
    sure = tuple(("sensor_gain", f"sensor:{k}", None) for k in range(proven))
    found = judge(evidence(gap, refits, sure))
    assert min(found.none, found.unexplained, found.several) >= 0
    assert all(0 <= p <= 1 for _, p in found.causes)
    assert [p for _, p in found.causes] == sorted((p for _, p in found.causes), reverse=True)
    if not proven:
        total = found.none + found.unexplained + sum(p for _, p in found.causes)
        assert total <= 1 + 1e-12
        assert total >= 1 - 0.02 * max(len(lefts), 1)  # rows below 1 % are left out
    shares = [share for _, share in found.where]
    assert sum(shares) == pytest.approx(1)
    assert shares == sorted(shares, reverse=True)
    assert found.word in ("none", "explained", "several", "unexplained")
    if found.word == "none" or (found.word == "unexplained" and not proven):
        assert found.present == ()
    else:  # what is proven is there even beside what nobody explains
        assert set(sure) <= set(found.present) != set()


directions = some.sampled_from(("tx", "ty", None))
effects = some.sampled_from(("sensor_gain", "feedback_delay"))


@given(
    gap=positive,
    causes=some.lists(some.tuples(effects, directions, positive), max_size=4),
    pairs=some.lists(some.tuples(some.integers(0, 3), some.integers(0, 3), positive), max_size=3),
    proven=some.lists(directions, max_size=2, unique=True),
)
def test_every_verdict_keeps_its_contract(gap, causes, pairs, proven):
    place = {"sensor_gain": "sensor:acc1", "feedback_delay": "joint:b"}
    refits = tuple(
        refit(effect, place[effect], 1e4 * (1 + left), left).model_copy(update={"dof": dof})
        for effect, dof, left in causes
    )
    two = tuple(
        pair(refits[i], refits[j], 1e4 * (1 + left), left)
        for i, j, left in pairs
        if max(i, j) < len(refits) and refits[i].key != refits[j].key
    )
    sure = tuple(("sensor_polarity", "sensor:acc2", dof) for dof in proven)
    found = judge(evidence(gap, refits, sure, pairs=two))
    rows = [
        {"effect": key[0], "location": key[1], "probability": p, "parameters": {}}
        for key, p in found.causes
    ]
    given = {
        "verdict": found.word,
        "probability": {
            "none": found.none,
            "unexplained": found.unexplained,
            "several": found.several,
        },
        "gap": {
            "as_drawn": None,
            "retuned": None,
            "after": None,
            "noise": None,
            "closed": None,
        },
        "where": [{"location": place, "share": share} for place, share in found.where],
        "causes": rows,
        "twins": [],
        "not_testable": [],
        "next_experiment": None,
    }
    with TemporaryDirectory() as folder:
        file = Path(folder) / "verdict.json"
        file.write_text(json.dumps(given), encoding="utf-8")
        assert read_verdict(file).verdict == found.word


def test_one_effect_at_one_place_in_two_directions_is_one_cause():
    one = refit("sensor_gain", "sensor:acc7", 5e4, 4.0).model_copy(update={"dof": "tx"})
    other = one.model_copy(update={"dof": "ty", "cost": 6e4, "chi_square": 6.0})
    found = judge(evidence(10.0, (one, other), pairs=(pair(one, other, 1e4, 0.0),)))
    assert found.word == "explained"
    assert set(found.present) == {one.key, other.key}
    ((row, probability),) = found.causes
    assert row[:2] == ("sensor_gain", "sensor:acc7")
    assert probability > 0.9
    # Rivals of one place are one cause in its better direction.
    worse = other.model_copy(update={"cost": 1.02e4, "chi_square": 1.02})
    better = one.model_copy(update={"cost": 1e4, "chi_square": 1.0})
    found = judge(evidence(10.0, (better, worse)))
    assert [key for key, _ in found.causes] == [better.key]
    assert found.present == (better.key,)


def test_what_a_gate_proved_is_there_beside_a_gap_that_nobody_explains():
    sure = (("sensor_polarity", "sensor:acc1", "tx"),)
    lost = judge(evidence(10.0, (refit("mass_error", "body:a", 1e5, 9.0),), sure))
    assert lost.word == "unexplained"
    assert lost.present == sure
    both = (*sure, ("sensor_swap", "sensor:acc2", None))
    assert judge(evidence(10.0, proven=both)).present == both


def test_no_gap_is_none_and_a_gap_that_nothing_takes_is_unexplained():
    assert judge(evidence(0.0)).word == "none"
    assert judge(evidence(0.0)).none > 0.9
    wrong = refit("mass_error", "body:a", 1e5, 9.0)
    lost = judge(evidence(10.0, (wrong,), gains=(5e4, 3e4, 1e4)))
    assert lost.word == "unexplained"
    assert lost.where[0][0] == "body:a"


def test_what_is_left_counts_beyond_what_counts_as_nothing():
    # A delay that leaves 1.028 of a gap of 0.3 explains it: badly known noise leaves as much.
    gap, least = 0.3, 0.03
    found = [
        judge(evidence(gap, (refit("feedback_delay", "joint:b", 1e4 * (1 + left), left),)))
        for left in (least - 0.002, least + 0.1)
    ]
    assert [one.word for one in found] == ["explained", "unexplained"]


def test_pairs_are_weighed_by_what_they_gain_beyond_the_best_single_effect():
    # Of a gap of 10^7 nats the first alone explains nearly all; 600 nats tell what is beside it.
    first, other, mass = (
        refit(effect, place, 2.6e4, 1.6)
        for effect, place in (
            ("support_loss", "joint:b"),
            ("joint_coupling", "joint:b"),
            ("mass_error", "body:a"),
        )
    )
    pairs = pair(first, mass, 1.06e4, 0.06), pair(other, mass, 1e4, 0.0)
    found = judge(evidence(1e3, (first, other, mass), pairs=pairs))
    assert found.word == "several"
    assert set(found.present) == {other.key, mass.key}
    assert dict(found.causes)[mass.key] > 0.9
    assert dict(found.causes).get(first.key, 0.0) < 0.1


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


def test_who_takes_most_of_a_large_gap_and_leaves_what_no_right_effect_does_explains_nothing():
    for gap, left, word in (
        (30.0, 0.14, "explained"),
        (500.0, 0.14, "explained"),
        (17.0, 0.9, "unexplained"),
        (180.0, 6.0, "unexplained"),
    ):
        one = refit("mass_error", "body:a", 1e4 * (1 + left), left)
        assert judge(evidence(gap, (one,))).word == word


def test_who_takes_the_gap_explains_it_and_equals_share():
    gap = 10.0
    right = refit("mass_error", "body:a", 1.01e4, 0.01)
    wrong = refit("appendage", "body:c", 6e4, 5.0)
    found = judge(evidence(gap, (right, wrong)))
    assert found.word == "explained"
    assert found.present == (right.key,)
    assert found.causes[0][1] > 0.9
    twin = refit("joint_coupling", "joint:b", 1.01e4, 0.01)
    both = judge(evidence(gap, (right, twin)))
    assert both.causes[0][1] == pytest.approx(both.causes[1][1])
    assert dict(both.where)["joint:b"] > 0.4
    # Three alike: none of them is likelier than not, but that one effect explains it is.
    third = refit("support_loss", "joint:c", 1.01e4, 0.01)
    three = judge(evidence(gap, (right, twin, third)))
    assert max(p for _, p in three.causes) < 0.5
    assert three.word == "explained"


@given(gap=positive, lefts=some.lists(positive, min_size=2, max_size=4), both=positive)
def test_sets_of_causes_share_one_probability(gap, lefts, both):
    refits = tuple(
        refit("mass_error", f"body:{k}", 1e4 * (1 + left), left) for k, left in enumerate(lefts)
    )
    two = pair(refits[0], refits[1], 1e4 * (1 + both), both)
    found = judge(evidence(gap, refits, pairs=(two,)))
    single = 1 - found.none - found.unexplained - found.several
    assert min(found.none, found.unexplained, found.several, single) >= -1e-12
    # One cause or two: each counts once for every set that it is in.
    total = sum(p for _, p in found.causes)
    assert total == pytest.approx(single + 2 * found.several, abs=0.02 * len(lefts))
    assert len(found.present) == {"explained": 1, "several": 2}.get(found.word, 0)


def test_two_effects_that_take_what_one_leaves_are_several():
    first, second = (
        refit(n, f"body:{n}", c, left) for n, c, left in (("a", 2e4, 1.0), ("b", 8e4, 7))
    )
    lone = judge(evidence(10.0, (first, second)))
    assert lone.word == "unexplained"
    found = judge(evidence(10.0, (first, second), pairs=(pair(first, second, 1.01e4, 0.0),)))
    assert found.word == "several"
    assert set(found.present) == {first.key, second.key}
    # What is outside the catalogue gives way to two effects in part only.
    part = judge(evidence(10.0, (first, second), pairs=(pair(first, second, 1.4e4, 0.4),)))
    assert part.word == "unexplained"
    # A single effect that leaves nothing needs no other.
    right = refit("a", "body:a", 1.01e4, 0.02)
    more = judge(evidence(10.0, (right, second), pairs=(pair(right, second, 1.005e4, 0.01),)))
    assert more.word == "explained"


def test_what_a_gate_proved_stays_and_comes_first():
    proven = (("sensor_swap", "sensor:acc1", "tx+ty"),)
    found = judge(evidence(0.0, (), proven))
    assert found.word == "explained"
    assert found.present == proven
    assert found.where[0][0] == "sensor:acc1"
    with_more = judge(evidence(10.0, (refit("drift", "joint:b", 1.01e4, 0.0),), proven))
    assert with_more.word == "several"
    assert {key for key, _ in with_more.causes} == {proven[0], ("drift", "joint:b", None)}


def test_a_body_that_bends_may_leave_a_gap():
    bent = (("flexible_body", "body:a", None),)
    assert judge(evidence(50.0, (), bent)).word == "explained"
    assert judge(evidence(50.0, (), (("sensor_gain", "sensor:acc1", "tx"),))).causes[0][1] < 0.7


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


def test_a_sensor_that_is_wrong_by_no_known_fault_is_something_missing():
    nothing = evidence(0.01)
    strange = nothing.model_copy(update={"unknown": ("sensor:acc9",)})
    before, found = judge(nothing), judge(strange)
    assert (before.word, found.word) == ("none", "unexplained")
    assert found.none + found.unexplained == pytest.approx(before.none + before.unexplained)
    assert found.where[0][0] == "sensor:acc9"
    # What explains all the rest is there beside it.
    one = refit("mass_error", "body:a", 1e4, 0.0)
    found = judge(evidence(3.0, (one,)).model_copy(update={"unknown": ("sensor:acc9",)}))
    assert found.word == "explained"
    assert found.where[0][0] == "body:a"


def test_where_forces_tell_no_difference_a_joint_comes_before_its_body():
    tied = judge(evidence(30.0, gains=(9.99e5, 9.98e5, 1e3)))
    assert tied.word == "unexplained"
    assert tied.where[0][0] == "joint:b"
    told = judge(evidence(30.0, gains=(9.99e5, 9.6e5, 1e3)))
    assert told.where[0][0] == "body:a"


def test_rivals_are_ranked_by_what_they_foretell():
    first, second = (
        refit("mass_error", "body:a", 1e4, 0.0),
        refit("appendage", "body:a", 1.001e4, 0.0),
    )
    assert judge(evidence(3.0, (first, second))).causes[0][0][0] == "mass_error"
    told = [
        one.model_copy(update={"foretold": score})
        for one, score in ((first, 1.5e4), (second, 1.1e4))
    ]
    ranked = judge(evidence(3.0, tuple(told))).causes
    assert ranked[0][0][0] == "appendage"
    assert ranked[0][1] > 0.9
    # Who is no rival stays as far behind as it was.
    third = refit("gyroscopic", "body:a", 1.3e4, 0.3)
    assert len(judge(evidence(3.0, (*told, third))).causes) == 1


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
