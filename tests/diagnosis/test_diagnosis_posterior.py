"""From evidence to probabilities: what must hold of any evidence, and of plain ones."""

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as some

from diagnosis.comparison.present import present_hypotheses
from diagnosis.inference.posterior import Posterior, judge
from tests.helpers.judged import evidence, pair, refit
from truth.grade.read_verdict import read_verdict

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


def test_twins_are_causes_that_may_stand_for_each_other():
    a, b, c, d = (("mass_error", f"body:{name}", None) for name in "abcd")
    turned = ("mass_error", "body:b", "x")
    sets = (((a,), 0.6), ((b,), 0.02), ((turned,), 0.02), ((c,), 0.025), ((d,), 0.003))
    judged = Posterior(0.1, 0.1, 0.0, (), (), (), sets)
    # 0.6 to 0.04, whose two directions are one cause, but not to 0.025; 0.003 is not worth a row.
    assert judged.twins == ((a[:2], b[:2]), (b[:2], c[:2]))
    # What is there at once is no alternative; what is there beside the same is.
    both = (((a, b), 0.5), ((a, c), 0.4), ((b,), 0.05))
    assert replace(judged, sets=both).twins == ((b[:2], c[:2]),)
    assert replace(judged, sets=()).twins == ()


def test_beside_what_a_gate_proved_the_likeliest_set_is_there():
    proven = (("sensor_gain", "sensor:acc1", "tx"),)
    one, other = (
        refit("appendage", f"body:{name}", 1e4 + 30 * k, 2e-4) for k, name in enumerate("ab")
    )
    seen = judge(evidence(5.0, (one, other), proven=proven))
    shares = dict(seen.sets)
    assert seen.word == "several"
    assert shares[one.key,] > shares[other.key,] > 0.3  # neither is likely by itself
    assert max(p for key, p in seen.causes if key not in proven) < 0.6
    assert seen.present == (*proven, one.key)
    assert seen.twins == ((one.key[:2], other.key[:2]),)
    # Of two at once both are, though nobody fitted the second alone.
    lone = refit("appendage", "body:a", 1.5e4, 0.5)
    second = refit("joint_coupling", "joint:b", 0.0, 0.0)
    both = pair(lone, second, 1e4, 2e-4)
    seen = judge(evidence(5.0, (lone,), proven=proven, pairs=(both,)))
    assert seen.present[:1] == proven
    assert set(seen.present[1:]) == set(both.keys)
    hypotheses = [SimpleNamespace(key=key, members=()) for key in (*proven, *both.keys)]
    made, *members = hypotheses
    fitted = SimpleNamespace(hypothesis=SimpleNamespace(key=lone.key, members=tuple(members)))
    alone = SimpleNamespace(hypothesis=SimpleNamespace(key=lone.key))
    found = SimpleNamespace(refits=(alone,), pairs=(fitted,))
    assert [one.key for one in present_hypotheses(seen, [made], found)] == list(seen.present)


@pytest.mark.parametrize(("left", "right"), [(2e-4, True), (0.1, False)])
def test_costs_of_rivals_count_as_far_as_the_best_leaves_nothing(left, right):
    # The wrong one foretells 300 nats more, as it may by chance; it costs 60 more.
    true, wrong = (
        refit("joint_coupling", "joint:b", 1e4, left),
        refit("support_loss", "joint:b", 10060, left),
    )
    seen = [
        one.model_copy(update={"foretold": score})
        for one, score in ((true, 5300.0), (wrong, 5000.0))
    ]
    found = judge(evidence(5.0, tuple(seen)))
    assert (found.causes[0][0] == true.key) is right
    # Who is no rival of theirs weighs as before.
    third = refit("mass_error", "body:a", 1e4 + 30, left)
    shares = dict(judge(evidence(5.0, (*seen, third))).causes)
    assert 0.01 < shares[third.key] < 0.3
