"""Two engines on the same cases: the interval of the difference, and McNemar's test."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from truth.grade.rates import mcnemar, paired_difference, wilson


def pairs(both, first, second, neither):
    given = ((True, True), both), ((True, False), first), ((False, True), second)
    return [pair for pair, n in (*given, ((False, False), neither)) for _ in range(n)]


def test_the_interval_is_the_published_one():
    # Newcombe 1998, table III: 20, 12, 2 and 16 of 50, method 10.
    found = paired_difference(pairs(20, 12, 2, 16))
    assert (found.n, found.first_alone, found.second_alone) == (50, 12, 2)
    assert found.difference == pytest.approx(0.2)
    assert (found.low, found.high) == pytest.approx((0.0562, 0.3290), abs=2e-3)


@given(st.integers(0, 60), st.integers(0, 60))
def test_the_test_is_the_binomial_one(first, second):
    if first + second:
        expected = binomtest(first, first + second, 0.5).pvalue
        assert mcnemar(first, second) == pytest.approx(expected)
    else:
        assert mcnemar(first, second) == 1


def test_engines_that_agree_differ_by_nothing_within_an_interval():
    found = paired_difference(pairs(40, 0, 0, 10))
    assert found.difference == 0
    assert found.low < 0 < found.high
    assert found.low == pytest.approx(-found.high)
    assert found.high < 0.1
    everything = paired_difference(pairs(50, 0, 0, 0))
    assert everything.low == pytest.approx(wilson(50, 50)[0] - 1)


def test_exchanged_engines_have_the_opposite_difference():
    one, other = paired_difference(pairs(20, 9, 3, 5)), paired_difference(pairs(20, 3, 9, 5))
    assert (one.low, one.high) == pytest.approx((-other.high, -other.low))
    assert one.p_value == other.p_value


def test_the_interval_holds_the_truth_as_often_as_it_says():
    random, chances = np.random.default_rng(4), (0.7, 0.12, 0.06, 0.12)
    counts = random.multinomial(60, chances, size=400)
    found = [paired_difference(pairs(*draw)) for draw in counts.tolist()]
    held = np.mean([one.low <= 0.06 <= one.high for one in found])
    assert 0.92 < held < 0.99


def test_without_cases_there_is_no_difference():
    with pytest.raises(ValueError, match="at least 1"):
        paired_difference([])
