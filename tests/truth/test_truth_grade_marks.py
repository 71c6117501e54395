"""Every mark, on verdicts and answers written by hand."""

import math

import pytest

from truth.grade.answer import TrueCause, Truth
from truth.grade.marks import FLOOR, MEANS, RATES, Excess, is_present, marks_of
from truth.grade.verdict import NOTHING_SAID, Row, StatedVerdict, first_of

APPENDAGE = ("appendage", "body:ty")
COUPLING = ("joint_coupling", "joint:ty")
MASS = ("mass_error", "body:ty")
OTHER = ("appendage", "body:tilt")

ONE = Truth((TrueCause(*APPENDAGE, dof="tz"),))
NONE = Truth()
UNKNOWN = Truth((TrueCause("unexplained", "joint:ty", kind="inerter"),))
TWO = Truth((TrueCause(*APPENDAGE), TrueCause(*COUPLING)))
MANY = Truth((*TWO.causes, TrueCause(*OTHER)))
HALF_KNOWN = Truth((TrueCause("unexplained", "joint:ty"), TrueCause(*APPENDAGE)))


def said(*causes, word="explained", none=0.0, unexplained=0.0, several=0.0, **more):
    rows = tuple(Row(*label, probability=p, dof="tz") for label, p in causes)
    return StatedVerdict(word, none, unexplained, several, rows, **more)


RIGHT = said((APPENDAGE, 0.9), (COUPLING, 0.1))
CASES = [
    # truth, verdict, marks that are expected
    (ONE, RIGHT, {"effect_first": 1, "place_first": 1, "both": 1, "top3": 1, "direction": 1}),
    (ONE, said((OTHER, 0.9)), {"effect_first": 1, "place_first": 0, "both": 0, "top3": 0}),
    (ONE, said((MASS, 0.9)), {"effect_first": 0, "place_first": 1, "both": 0, "direction": None}),
    (ONE, said((MASS, 0.4), (OTHER, 0.3), (APPENDAGE, 0.2)), {"both": 0, "top3": 1}),
    (
        ONE,
        said((MASS, 0.4), (OTHER, 0.3), (COUPLING, 0.2), (APPENDAGE, 0.1)),
        {"both": 0, "top3": 0},
    ),
    (ONE, said(word="none", none=1.0), {"effect_first": 0, "place_first": 0, "false_alarm": None}),
    (ONE, NOTHING_SAID, {"effect_first": 0, "both": 0, "top3": 0, "verdict_is_first": 0}),
    (NONE, said(word="none", none=1.0), {"effect_first": 1, "both": 1, "false_alarm": 0}),
    (NONE, said(word="none", none=1.0), {"place_first": None, "where_first": None, "top3": None}),
    (NONE, said((MASS, 0.6), none=0.4), {"effect_first": 0, "both": 0, "false_alarm": 1}),
    (NONE, said(word="unexplained", unexplained=1.0), {"false_alarm": 1}),
    (NONE, said((MASS, 0.6), word="none", none=0.4), {"false_alarm": 1, "verdict_is_first": 0}),
    (NONE, NOTHING_SAID, {"effect_first": 0, "false_alarm": 1}),
    (
        UNKNOWN,
        said(word="unexplained", unexplained=1.0, where=(("joint:ty", 0.5),)),
        {"effect_first": 1, "place_first": 1, "both": 1, "unknown_rejected": 1,
         "unknown_placed": 1, "where_first": 1, "top3": None, "false_alarm": None},
    ),
    (
        UNKNOWN,
        said(word="unexplained", unexplained=1.0, where=(("body:ty", 0.5), ("joint:ty", 0.4))),
        {"both": 0, "unknown_rejected": 1, "unknown_placed": 0, "where_first": 0,
         "where_top3": 1},
    ),
    (UNKNOWN, said(word="unexplained", unexplained=1.0), {"unknown_placed": 0, "where_top3": 0}),
    (ONE, said((APPENDAGE, 1), where=(("body:x", 0.5),)), {"where_first": 0, "where_top3": 0}),
    (
        ONE,
        said((APPENDAGE, 1), where=(*((f"body:{i}", 0.3) for i in "xyz"), ("body:ty", 0.1))),
        {"where_first": 0, "where_top3": 0},
    ),
    (UNKNOWN, RIGHT, {"effect_first": 0, "unknown_rejected": 0, "unknown_placed": None}),
    (
        TWO,
        said((COUPLING, 0.9), (APPENDAGE, 0.9), word="several", several=0.8),
        {"effect_first": 1, "both": 1, "several_said": 1, "both_found": 1, "largest_first": 0,
         "top3": None, "place_first": 1},
    ),
    (
        TWO,
        said((APPENDAGE, 0.9), (MASS, 0.85), (COUPLING, 0.1), word="several", several=0.8),
        {"several_said": 1, "both_found": 0, "largest_first": 1},
    ),
    (TWO, RIGHT, {"effect_first": 0, "several_said": 0, "both_found": 0, "largest_first": 1}),
    (TWO, NOTHING_SAID, {"several_said": 0, "both_found": 0, "largest_first": 0}),
    (MANY, RIGHT, {"both_found": None, "largest_first": 1, "several_said": 0}),
    (HALF_KNOWN, RIGHT, {"both_found": None, "largest_first": None, "several_said": 0}),
]  # fmt: skip


@pytest.mark.parametrize(("truth", "verdict", "expected"), CASES)
def test_marks_are_as_expected(truth, verdict, expected):
    marks = marks_of(truth, verdict)
    assert {name: marks[name] for name in expected} == expected


def test_every_mark_has_a_meaning_and_every_meaning_a_mark():
    for truth in (ONE, NONE, UNKNOWN, TWO):
        assert set(marks_of(truth, RIGHT)) == set(RATES) | set(MEANS)


def test_a_twin_of_the_first_counts_where_twins_count():
    twins = (frozenset({APPENDAGE, COUPLING}),)
    marks = marks_of(ONE, said((COUPLING, 0.9), twins=twins))
    assert (marks["effect_first"], marks["effect_or_twin"]) == (0, 1)
    assert (marks["both"], marks["both_or_twin"], marks["twin_set"]) == (0, 1, 2)


def test_a_cause_is_at_each_of_the_places_that_the_test_cannot_tell_apart():
    row = Row(*OTHER, probability=0.9, dof="tz", places=(OTHER[1], APPENDAGE[1]))
    marks = marks_of(ONE, StatedVerdict("explained", causes=(row,)))
    assert (marks["both"], marks["place_first"], marks["places"]) == (1, 1, 2)
    assert marks["probability_of_truth"] == 0.9
    assert marks_of(ONE, RIGHT)["places"] == 1
    both = StatedVerdict("several", several=0.9, causes=(row, Row(*COUPLING, probability=0.9)))
    assert marks_of(TWO, both)["both_found"] == 1


def test_a_twin_at_another_place_or_of_another_cause_does_not_count():
    for group in ({OTHER, COUPLING}, {APPENDAGE, MASS}):
        marks = marks_of(ONE, said((COUPLING, 0.9), twins=(frozenset(group),)))
        assert (marks["effect_or_twin"], marks["both_or_twin"]) == (0, 0)


def test_a_wrong_direction_is_wrong_and_one_not_stated_is_not_asked():
    wrong = Truth((TrueCause(*APPENDAGE, dof="ty"),))
    assert marks_of(wrong, RIGHT)["direction"] == 0
    assert marks_of(Truth((TrueCause(*APPENDAGE),)), RIGHT)["direction"] is None


def test_the_word_must_be_that_of_the_first_hypothesis():
    assert marks_of(ONE, RIGHT)["verdict_is_first"] == 1
    assert marks_of(ONE, said((MASS, 0.9), word="none", none=0.1))["verdict_is_first"] == 0


def test_probability_brier_and_log_score_of_a_cause():
    verdict = said((APPENDAGE, 0.7), (MASS, 0.1), none=0.15, unexplained=0.05)
    marks = marks_of(ONE, verdict)
    assert marks["probability_of_truth"] == 0.7
    assert marks["brier"] == pytest.approx(0.3**2 + 0.1**2 + 0.15**2 + 0.05**2)
    assert marks["log_score"] == pytest.approx(-math.log(0.7))


def test_a_truth_that_is_not_stated_costs_a_whole_one():
    marks = marks_of(ONE, said((MASS, 0.8), none=0.2))
    assert marks["probability_of_truth"] == 0
    assert marks["brier"] == pytest.approx(0.8**2 + 0.2**2 + 1)
    assert marks["log_score"] == pytest.approx(-math.log(FLOOR))


@pytest.mark.parametrize(
    ("truth", "verdict", "probability"),
    [
        (NONE, said((MASS, 0.6), none=0.4), 0.4),
        (UNKNOWN, said((MASS, 0.7), unexplained=0.3), 0.3),
        (TWO, said((APPENDAGE, 0.9), (COUPLING, 0.9), word="several", several=0.8), 0.8),
        (ONE, said((APPENDAGE, 0.95), (MASS, 0.5), several=0.45), 0.5),
    ],
)
def test_the_truths_probability_is_that_of_its_hypothesis(truth, verdict, probability):
    assert marks_of(truth, verdict)["probability_of_truth"] == pytest.approx(probability)


def test_a_verdict_that_cannot_be_read_has_the_worst_scores():
    marks = marks_of(ONE, NOTHING_SAID, Excess(5.0, 1.0))
    assert (marks["brier"], marks["probability_of_truth"], marks["shrink_share"]) == (2, 0, 0)
    assert marks["log_score"] == pytest.approx(-math.log(FLOOR))
    assert marks["twin_set"] is None


def test_a_cause_is_present_among_several_at_its_own_place_only():
    assert is_present(TWO, Row(*COUPLING, 0.5))
    assert not is_present(TWO, Row(*OTHER, 0.5))
    assert not is_present(NONE, Row(*COUPLING, 0.5))


@pytest.mark.parametrize(
    ("excess", "retuned", "after", "share"),
    [
        (Excess(5.0, 1.0), 5.0, 1.0, 1.0),
        (Excess(5.0, 1.0), 4.0, 2.0, 0.875),
        (Excess(5.0, 1.0), 4.0, 6.0, 0.0),
        (Excess(5.0, 2.0), 1000.0, 1.0, 1.0),
        (Excess(5.0, 1.0), 4.0, None, 0.0),
        (Excess(5.0, 1.0), None, 1.0, 1.0),
        (Excess(1.25, 0.75), 1.25, 1.0, 0.5625),
        (Excess(1.09, 1.0), 4.0, 2.0, None),
        (Excess(5.0, 5.0), 4.0, 2.0, None),
        (Excess(None, 1.0), 4.0, 2.0, None),
        (Excess(5.0, None), 4.0, 2.0, None),
    ],
)
def test_the_shrink_is_a_share_of_the_oracles(excess, retuned, after, share):
    verdict = said((MASS, 1.0), retuned=retuned, after=after)
    assert marks_of(ONE, verdict, excess)["shrink_share"] == share


def test_the_first_of_several_with_a_small_joint_probability_is_a_cause():
    assert first_of(said((APPENDAGE, 0.9), (MASS, 0.2), several=0.1)).effect == "appendage"
