"""What a verdict's probabilities say of each hypothesis alone, and which comes first."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from truth.grade.verdict import NOTHING_SAID, Row, StatedVerdict, alone, first_of, twins_of, word_of


def rows(*probabilities):
    return tuple(
        Row("mass_error", f"body:{number}", one) for number, one in enumerate(probabilities)
    )


def test_rows_that_sum_to_the_rest_are_taken_as_they_stand():
    verdict = StatedVerdict("explained", 0.1, 0.1, 0.2, causes=rows(0.4, 0.2))
    assert alone(verdict) == pytest.approx((0.4, 0.2))


def test_what_is_in_a_set_is_taken_off_its_rows():
    # Alone 0.5 and 0.05, both together 0.45: they are present with 0.95 and 0.5.
    verdict = StatedVerdict("explained", 0, 0, 0.45, causes=rows(0.95, 0.5))
    assert alone(verdict) == pytest.approx((0.5, 0.05))
    assert first_of(verdict).place == "body:0"


def test_two_that_are_certain_together_are_nothing_alone():
    verdict = StatedVerdict("several", 0, 0, 0.9, causes=rows(0.95, 0.95))
    assert alone(verdict) == pytest.approx((0.05, 0.05))
    first = first_of(verdict)
    assert (first.effect, first.place, first.probability) == ("several", "body:0", 0.9)
    assert word_of(first) == "several"


@st.composite
def mixtures(draw):
    """Hypotheses that sum to 1: none, unexplained, each of n causes alone, each pair of them."""
    count = draw(st.integers(2, 5))
    pairs = [(i, j) for j in range(count) for i in range(j)]
    weights = draw(
        st.lists(
            st.integers(0, 100), min_size=2 + count + len(pairs), max_size=2 + count + len(pairs)
        ).filter(any)
    )
    parts = [weight / sum(weights) for weight in weights]
    single, double = parts[2 : 2 + count], dict(zip(pairs, parts[2 + count :], strict=True))
    present = [
        own + sum(part for pair, part in double.items() if i in pair)
        for i, own in enumerate(single)
    ]
    present = [min(1.0, one) for one in present]
    several = min(1.0, sum(double.values()))
    return StatedVerdict("explained", *parts[:2], several, rows(*sorted(present, reverse=True)))


@given(mixtures())
def test_the_hypotheses_of_an_honest_verdict_sum_to_one(verdict):
    own = alone(verdict)
    total = verdict.none + verdict.unexplained + verdict.several + sum(own)
    assert total == pytest.approx(1, abs=1e-9)
    for row, one in zip(verdict.causes, own, strict=True):
        assert max(0, row.probability - verdict.several) - 1e-9 <= one <= row.probability


def test_of_equal_hypotheses_the_verdicts_word_decides():
    for word, effect in [("none", "none"), ("unexplained", "unexplained")]:
        verdict = StatedVerdict(word, 0.5, 0.5)
        assert first_of(verdict).effect == effect
    explained = StatedVerdict("explained", none=0.5, causes=rows(0.5))
    assert first_of(explained).effect == "mass_error"


def test_of_an_unexplained_gap_the_place_is_where_most_of_it_is():
    verdict = StatedVerdict(
        "unexplained", unexplained=0.9, causes=rows(0.1), where=(("joint:ty", 0.7), ("body:0", 0.1))
    )
    assert first_of(verdict).place == "joint:ty"
    assert first_of(StatedVerdict("unexplained", unexplained=1.0)).place == ""


def test_where_nothing_is_said_nothing_is_first():
    first = first_of(NOTHING_SAID)
    assert (first.effect, first.place, first.probability, first.row) == ("failed", "", 0, None)


def test_twins_are_those_of_every_set_that_has_the_cause():
    a, b, c, d = [("mass_error", f"body:{number}") for number in range(4)]
    verdict = StatedVerdict(
        "explained", twins=(frozenset({a, b}), frozenset({a, c}), frozenset({c, d}))
    )
    assert twins_of(verdict, rows(1.0)[0]) == {a, b, c}
    assert twins_of(StatedVerdict("explained"), rows(1.0)[0]) == {a}
