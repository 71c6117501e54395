"""Scores of many cases: groups, calibration, confusion."""

import pytest

from truth.grade.answer import TrueCause, Truth
from truth.grade.marks import marks_of
from truth.grade.rates import wilson
from truth.grade.scores import Judged, ratio_of, scores_of
from truth.grade.verdict import NOTHING_SAID, Row, StatedVerdict

APPENDAGE = Row("appendage", "body:ty", 0.9)
GAIN = Row("sensor_gain", "sensor:acc4", 0.7)


def truth_of(row, ratio=None):
    return Truth((TrueCause(row.effect, row.location, ratio=ratio),))


def judged(truth, verdict, name="a", machine="stack", tags=()):
    return Judged(name, machine, tags, truth, marks_of(truth, verdict), verdict)


RIGHT = StatedVerdict(
    "explained", 0.1, causes=(APPENDAGE,), where=(("body:ty", 0.6), ("joint:ty", 0.2))
)
WRONG = StatedVerdict("explained", 0.3, causes=(GAIN,), where=(("sensor:acc4", 0.9),))
QUIET = StatedVerdict("none", 0.97)
CASES = [
    judged(truth_of(APPENDAGE, 4.2), RIGHT, "a", tags=("twin",)),
    judged(truth_of(APPENDAGE, 1.1), WRONG, "b", tags=("twin", "levels")),
    judged(truth_of(GAIN, 0.0), WRONG, "c", machine="tree"),
    judged(Truth(), QUIET, "d"),
    judged(Truth(mistuned=True), RIGHT, "e"),
    judged(truth_of(APPENDAGE, 30.0), NOTHING_SAID, "f"),
]


def test_all_cases_are_counted_the_failed_ones_as_wrong():
    rate = scores_of(CASES).all.rates["effect_first"]
    assert (rate.n, rate.hits) == (6, 3)
    assert (rate.low, rate.high) == wilson(3, 6)
    alarms = scores_of(CASES).all.rates["false_alarm"]
    assert (alarms.n, alarms.hits) == (2, 1)


def test_every_case_is_in_its_groups():
    scores = scores_of(CASES)
    assert {label: group.n for label, group in scores.by_effect.items()} == {
        "appendage": 3,
        "mistuned": 1,
        "none": 1,
        "sensor_gain": 1,
    }
    assert {label: group.n for label, group in scores.by_place.items()} == {
        "body": 3,
        "none": 2,
        "sensor": 1,
    }
    assert {label: group.n for label, group in scores.by_ratio.items()} == {
        "0.125": 1,
        "1": 1,
        "4": 1,
        "8": 1,
        "none": 2,
    }
    assert {label: group.n for label, group in scores.by_machine.items()} == {
        "stack": 5,
        "tree": 1,
    }
    assert {label: group.n for label, group in scores.by_tag.items()} == {"levels": 1, "twin": 2}
    assert scores.by_effect["appendage"].rates["both"].hits == 1


@pytest.mark.parametrize(
    ("ratio", "nearest"),
    [
        (0.01, "0.125"),
        (0.3, "0.25"),
        (0.71, "1"),
        (1.4, "1"),
        (1.45, "2"),
        (2.8, "2"),
        (2.9, "4"),
        (5.6, "4"),
        (5.7, "8"),
    ],
)
def test_a_ratio_goes_to_the_nearest_by_its_logarithm(ratio, nearest):
    assert ratio_of(truth_of(GAIN, ratio)) == nearest


def test_of_several_effects_the_first_gives_the_ratio():
    causes = (*truth_of(GAIN, 2.0).causes, *truth_of(APPENDAGE, 8.0).causes)
    assert ratio_of(Truth(causes)) == "2"


def test_first_hypotheses_are_calibrated_with_effect_and_place():
    bins = scores_of(CASES).calibration.first.bins
    # 0.7: wrong and right; 0.9: right, and wrong where nothing was; 0.97: right.
    assert [(one.true.n, one.true.hits) for one in bins] == [(0, 0), (2, 1), (2, 1), (1, 1)]
    elsewhere = judged(truth_of(Row("appendage", "body:x", 1)), RIGHT)
    assert scores_of([elsewhere]).calibration.first.bins[2].true.hits == 0


def test_causes_are_calibrated_by_their_presence_also_among_several():
    both = Truth((*truth_of(GAIN).causes, *truth_of(APPENDAGE).causes))
    said = StatedVerdict(
        "several", 0, 0, 0.7, causes=(APPENDAGE, GAIN, Row("appendage", "body:x", 0.2))
    )
    bins = scores_of([judged(both, said)]).calibration.causes.bins
    assert [(one.true.n, one.true.hits) for one in bins] == [(1, 0), (1, 1), (1, 1), (0, 0)]


def test_shares_are_calibrated_by_their_places():
    bins = scores_of(CASES[:3]).calibration.shares.bins
    assert [(one.true.n, one.true.hits) for one in bins] == [(1, 0), (1, 1), (2, 1), (0, 0)]


def test_verdicts_that_cannot_be_read_state_no_probability():
    calibration = scores_of(CASES).calibration
    assert (calibration.first.n, calibration.causes.n) == (5, 4)


def test_confusion_tells_what_was_said_of_each_truth():
    confusion = scores_of(CASES).confusion
    assert confusion.effects == {
        "appendage": {"appendage": 1, "sensor_gain": 1, "failed": 1},
        "sensor_gain": {"sensor_gain": 1},
        "none": {"none": 1},
        "mistuned": {"appendage": 1},
    }
    assert confusion.kinds == {
        "body": {"body": 1, "sensor": 1, "failed": 1},
        "sensor": {"sensor": 1},
        "nowhere": {"nowhere": 1, "body": 1},
    }
    assert confusion.places["tree"] == {"sensor:acc4": {"sensor:acc4": 1}}
    assert confusion.places["stack"]["body:ty"] == {"body:ty": 1, "sensor:acc4": 1, "failed": 1}


def test_without_verdicts_there_are_marks_alone():
    chance = Judged("a", "stack", (), Truth(), {"both": 0.25}, None)
    scores = scores_of([chance])
    assert scores.all.rates["both"].rate == 0.25
    assert scores.all.rates["top3"].n == 0
    assert (scores.calibration, scores.sizes, scores.confusion) == (None, None, None)
