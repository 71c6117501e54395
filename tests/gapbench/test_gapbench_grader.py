"""The grader against marks computed by hand."""

import json
import math

import pytest

from gapbench.answer import NO_ANSWER, AnswerError, read_answer
from gapbench.grader import grade
from gapbench.table import difference, markdown, summary

EFFECTS = frozenset({"appendage", "mass_error", "sensor_gain", "sensor_delay"})
MASS = {
    "effect": "mass_error",
    "places": ["body:b"],
    "alike": ["body:c"],
    "near": ["body:a"],
    "size": 10.0,
    "neutral": 0.0,
}
GAIN = {
    "effect": "sensor_gain",
    "places": ["sensor:acc1"],
    "alike": [],
    "near": ["sensor:acc2"],
    "size": 1.2,
    "neutral": 1.0,
}
ONE = {"causes": [MASS], "background": [["sensor_delay", "sensor:acc9"]]}
TWO = {"causes": [MASS, GAIN], "background": []}
NOTHING = {"causes": [], "background": []}


def answer(*sets, none=0.0, unexplained=0.0, gap=None):
    """Return an answer; a set is its probability and effects with their places."""
    rows = [
        {
            "probability": p,
            "causes": [{"effect": e, "places": [*s], **more} for e, s, more in causes],
        }
        for p, *causes in sets
    ]
    given = {"format": 1, "none": none, "unexplained": unexplained, "sets": rows, "gap": gap}
    return read_answer(json.dumps(given), EFFECTS)


def mass(*places, **more):
    return ("mass_error", places, more)


def test_a_perfect_answer_has_full_marks():
    said = answer((1.0, mass("body:b", size=10.5, interval=[9, 11])), gap=[5.0, 1.0])
    marks = grade(said, ONE)
    assert marks == {
        **dict.fromkeys(("right", "effect", "place", "set", "size", "inside"), 1.0),
        **{"shrink": 1 - 0.2**2, "log": 0.0, "brier": 0.0, "wrong": 0.0, "false_alarm": None},
    }


@pytest.mark.parametrize("key", [ONE, TWO, NOTHING])
def test_an_empty_answer_has_none(key):
    marks = grade(NO_ANSWER, key)
    assert marks["right"] == 0
    assert {marks[name] for name in ("effect", "place", "set", "shrink")} <= {0.0, None}
    assert marks["log"] == pytest.approx(math.log(1000))
    assert marks["brier"] == 1
    assert marks["false_alarm"] == (1.0 if key is NOTHING else None)


@pytest.mark.parametrize(
    ("places", "credit", "right"),
    [
        (["body:b"], 1.0, 1),
        (["body:c"], 1.0, 1),
        (["body:a"], 0.5, 0),
        (["body:z"], 0.0, 0),
        (["body:b", "body:c"], 1.0, 1),
        (["body:b", "body:a"], 0.75, 1),
        (["body:b", "body:z"], 0.5, 1),
        (["body:b", "body:y", "body:z"], 1 / 3, 0),
    ],
)
def test_places_have_credit(places, credit, right):
    marks = grade(answer((0.8, mass(*places)), none=0.2), ONE)
    assert marks["place"] == pytest.approx(credit)
    assert (marks["right"], marks["set"], marks["effect"]) == (right, right, 1.0)
    p = 0.8 if right else 0.0
    assert marks["log"] == pytest.approx(-math.log(max(p, 1e-3)))
    assert marks["brier"] == pytest.approx((1 - p) ** 2 + 0.04 + (0 if right else 0.64))
    assert marks["wrong"] == 1 - right


def test_a_cause_too_many_or_too_few_is_not_right():
    one = grade(answer((0.9, mass("body:b"))), TWO)
    assert (one["right"], one["effect"], one["place"], one["set"]) == (0, 0.5, 0.5, 0.5)
    both = (0.9, mass("body:b"), ("sensor_gain", ["sensor:acc1"], {"size": 1.21}))
    assert grade(answer(both), TWO)["right"] == 1
    more = grade(answer(both), {**ONE, "background": []})
    assert (more["right"], more["set"], more["wrong"]) == (0, 0.5, 1)


def test_small_imperfections_are_neither_right_nor_wrong():
    beside = (0.9, mass("body:b"), ("sensor_delay", ["sensor:acc9"], {}))
    marks = grade(answer(beside), ONE)
    assert (marks["right"], marks["set"], marks["wrong"]) == (1, 1, 0)
    only = {**NOTHING, "background": ONE["background"]}
    assert grade(answer((0.9, ("sensor_delay", ["sensor:acc9"], {}))), only)["wrong"] == 0
    assert grade(answer(unexplained=0.9), only)["right"] == 1
    assert grade(answer(unexplained=0.9), NOTHING)["false_alarm"] == 1


def test_sizes_count_by_their_distance_from_no_effect():
    near, far = (("sensor_gain", ["sensor:acc1"], {"size": size}) for size in (1.219, 1.221))
    key = {"causes": [GAIN], "background": []}
    assert grade(answer((1.0, near)), key)["size"] == 1
    assert grade(answer((1.0, far)), key)["size"] == 0
    assert grade(answer((1.0, mass("body:z", size=10.0))), ONE)["size"] is None
    assert grade(answer((1.0, mass("body:b", interval=[10.1, 12]))), ONE)["inside"] == 0


def test_shrink_counts_only_where_the_answer_is_right():
    assert grade(answer((1.0, mass("body:z")), gap=[5, 1]), ONE)["shrink"] == 0
    assert grade(answer((1.0, mass("body:b"))), ONE)["shrink"] == 0
    assert grade(answer((1.0, mass("body:b")), gap=[5, 6]), ONE)["shrink"] == 0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "not JSON"),
        ("[]", "format"),
        ('{"format": 2}', "format"),
        ('{"format": 1, "none": NaN}', "finite"),
        ('{"format": 1, "none": 0.7, "unexplained": 0.7}', "sum to 1.4"),
        ('{"format": 1, "none": -0.1}', "less than 0"),
        ('{"format": 1, "sets": [{"probability": 1, "causes": []}]}', "0 causes"),
        ('{"format": 1, "sets": [3]}', "no object"),
        ('{"format": 1, "sets": [{"probability": 1, "causes": [{"effect": "x"}]}]}', "one of"),
        (
            '{"format": 1, "sets": [{"probability": 1, "causes": [{"effect": "mass_error"}]}]}',
            "places",
        ),
        ('{"format": 1, "gap": [1]}', "two numbers"),
    ],
)
def test_what_breaks_the_format_is_refused(text, says):
    with pytest.raises(AnswerError, match=says):
        read_answer(text, EFFECTS)


def test_the_table_has_intervals_of_rates_and_of_differences():
    def rows(marks):
        return [
            {"case": str(k), "stratum": "exact", **grade(said, ONE), "core_seconds": 2.0}
            for k, said in enumerate(marks)
        ]

    right, wrong = answer((1.0, mass("body:b"))), answer(unexplained=1.0)
    first, second = rows([right] * 8 + [wrong] * 2), rows([right] * 3 + [wrong] * 7)
    assert summary(first)[:3] == ("10", "80 % [49, 94]", "0.80")
    # Newcombe (1998), method 10, with a 3, b 5, c 0, d 2, by hand: phi 0.055.
    assert difference(first, second) == "+50 % [+8, +73], n 10"
    text = markdown({"ours": first, "theirs": second})
    assert "| theirs | 10 | 30 % [11, 60] |" in text
    assert "| ours less theirs | +50 % [+8, +73], n 10 |" in text
