"""Verdicts on machines that have small imperfections beside their faults."""

import pytest

from tests.bench.beside_background import (
    all_found,
    is_established,
    probability_on,
    right_first,
    truth_is_first,
    wrong_causes,
)
from truth.grade.answer import TrueCause, Truth, answer_from
from truth.grade.marks import marks_of
from truth.grade.read_verdict import verdict_from
from truth.grade.verdict import PARTLY, Row, StatedVerdict, first_of

FAULT = ("appendage", "body:ty")
ITEM = ("joint_coupling", "joint:ty")
OTHER = ("mass_error", "body:tilt")
MACHINE = Truth((TrueCause(*FAULT),), background=(ITEM,))
DIRT_ALONE = Truth(background=(ITEM,))
PAIR = Truth((TrueCause(*FAULT), TrueCause(*OTHER)))


def said(*causes, word=PARTLY, retuned=5.0, after=None, **more):
    """A verdict of causes with their probability and the excess with each of them."""
    rows = tuple(Row(*label, probability=p, excess_after=excess) for label, p, excess in causes)
    return StatedVerdict(word, causes=rows, retuned=retuned, after=after, **more)


@pytest.mark.parametrize(
    ("probability", "after", "established"),
    [
        (0.5, 4.48, True),  # 25 - 20.07 of 24
        (0.5, 4.50, False),  # 25 - 20.25 of 24
        (0.49, 1.0, False),
        (1.0, 1.0, True),
        (1.0, None, False),
    ],
)
def test_a_cause_is_established_if_it_is_likely_and_closes_a_fifth(probability, after, established):
    verdict = said((FAULT, probability, after))
    assert is_established(verdict, verdict.causes[0]) is established


def test_the_first_cause_may_take_its_excess_from_the_verdict():
    verdict = said((FAULT, 0.9, None), (ITEM, 0.6, None), after=1.2)
    assert [is_established(verdict, row) for row in verdict.causes] == [True, False]
    no_gap = said((FAULT, 0.9, 0.9), retuned=1.0)
    assert not is_established(no_gap, no_gap.causes[0])
    unknown = said((FAULT, 0.9, 1.0), retuned=None)
    assert not is_established(unknown, unknown.causes[0])


def test_an_established_item_of_the_background_counts_as_right():
    verdict = said((ITEM, 0.8, 2.0), (FAULT, 0.3, 3.0))
    assert right_first(MACHINE, verdict)
    assert not truth_is_first(MACHINE, verdict)
    assert wrong_causes(MACHINE, verdict) == wrong_causes(DIRT_ALONE, verdict) == ()


def test_an_item_that_is_not_established_is_wrong():
    small = said((ITEM, 0.8, 4.9), (FAULT, 0.3, 3.0))
    assert not right_first(MACHINE, small)
    assert [row.effect for row in wrong_causes(DIRT_ALONE, small)] == ["joint_coupling"]
    unlikely = said((ITEM, 0.4, 2.0), word="unexplained")
    assert not right_first(MACHINE, unlikely)
    assert wrong_causes(MACHINE, unlikely) == ()


def test_another_effect_or_place_is_wrong():
    verdict = said((("appendage", "body:tilt"), 0.9, 1.1), (FAULT, 0.05, 3.0))
    assert not right_first(MACHINE, verdict)
    assert len(wrong_causes(MACHINE, verdict)) == 1
    assert probability_on(MACHINE, verdict) == 0.05
    assert not right_first(MACHINE, said(word="unexplained"))


def test_several_are_found_if_all_are_among_the_first_and_likely():
    assert all_found(PAIR, said((OTHER, 0.9, 3.0), (FAULT, 0.6, 3.0)))
    assert not all_found(PAIR, said((OTHER, 0.9, 3.0), (ITEM, 0.8, 3.0), (FAULT, 0.6, 3.0)))
    assert not all_found(PAIR, said((OTHER, 0.9, 3.0), (FAULT, 0.4, 3.0)))
    assert not all_found(PAIR, said((OTHER, 0.9, 3.0)))
    assert all_found(Truth(), said(word="none"))
    assert probability_on(PAIR, said((OTHER, 0.9, 3.0), (FAULT, 0.6, 3.0))) == 0.6
    assert probability_on(Truth(), said(word="none", none=0.97)) == 0.97


def test_partly_is_a_word_of_the_contract_that_fits_any_set_of_causes():
    gap = {"error": 0.3, "excess": 5.0}
    cause = {"effect": "appendage", "location": "body:ty", "dof": "tz", "probability": 0.9}
    given = {
        "verdict": "partly",
        "probability": {"none": 0.0, "unexplained": 0.1, "several": 0.0},
        "gap": {"as_drawn": gap, "retuned": gap, "after": gap, "noise": 0.1, "closed": 0.9},
        "where": [{"location": "body:ty", "share": 0.9}],
        "causes": [cause | {"parameters": {"mass": 3.0}, "interval": {}, "excess_after": 2.5}],
        "twins": [],
        "not_testable": [],
        "next_experiment": None,
        "rest": {"excess": 2.5, "significant": True},
    }
    verdict = verdict_from(given)
    assert (verdict.verdict, verdict.causes[0].excess_after) == ("partly", 2.5)
    assert first_of(verdict).row == verdict.causes[0]
    marks = marks_of(MACHINE, verdict)
    assert (marks["verdict_is_first"], marks["both"], marks["several_said"]) == (1, 1, None)
    two = said((FAULT, 0.9, 3.0), (OTHER, 0.8, 3.0), several=0.8)
    assert marks_of(PAIR, two)["several_said"] == marks_of(PAIR, two)["both_found"] == 1
    one = said((FAULT, 0.9, 3.0), (OTHER, 0.2, 3.0))
    assert marks_of(PAIR, one)["both_found"] == 0


def test_an_answer_may_be_read_already():
    item = {"effect": "joint_coupling", "location": "joint:ty"}
    given = {"effect": "none", "dirt": {"item": [item]}}
    assert answer_from(given, "answer") == DIRT_ALONE
