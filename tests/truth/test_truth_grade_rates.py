"""Rates, intervals, quantiles and calibration, against SciPy and by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from truth.grade.rates import BINS, diagram_of, quantile, rate_of, spread_of, wilson


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_the_interval_is_that_of_scipy(case):
    hits, n = case
    expected = binomtest(hits, n).proportion_ci(0.95, method="wilson")
    assert wilson(hits, n) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_the_ends_of_the_interval_are_exact():
    assert wilson(0, 7)[0] == 0
    assert wilson(7, 7)[1] == 1


@pytest.mark.parametrize(("hits", "n"), [(0, 0), (-1, 3), (4, 3)])
def test_impossible_counts_are_refused(hits, n):
    with pytest.raises(ValueError, match="expected hits from 0 to n"):
        wilson(hits, n)


def test_a_mark_that_is_not_asked_is_not_counted():
    rate = rate_of([1.0, None, 0.0, 1.0, None])
    assert (rate.n, rate.hits, rate.rate) == (3, 2, pytest.approx(2 / 3))
    assert (rate.low, rate.high) == wilson(2, 3)


def test_nothing_counted_has_no_rate():
    rate = rate_of([None, None])
    assert (rate.n, rate.rate, rate.low, rate.high) == (0, None, None, None)


def test_an_expectation_has_no_interval():
    rate = rate_of([0.25, 1.0])
    assert (rate.rate, rate.low, rate.high) == (0.625, None, None)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30), st.floats(0, 1))
def test_quantiles_are_those_of_numpy(values, part):
    assert quantile(values, part) == pytest.approx(np.quantile(values, part), rel=1e-9, abs=1e-6)


def test_a_spread_tells_mean_median_quantile_and_largest():
    spread = spread_of([3.0, None, 1.0, 8.0])
    assert (spread.n, spread.mean, spread.median, spread.largest) == (3, 4.0, 3.0, 8.0)
    assert spread.ninety == pytest.approx(7.0)
    assert spread_of([None]).mean is None


def test_statements_fall_into_their_bins():
    stated = [0.0, 0.49, 0.5, 0.79, 0.8, 0.94, 0.95, 1.0, 1.0]
    diagram = diagram_of((one, True) for one in stated)
    assert [one.true.n for one in diagram.bins] == [2, 2, 2, 3]
    assert [(one.low, one.high) for one in diagram.bins] == list(BINS)


def test_the_calibration_error_of_a_hand_made_case():
    # Bin 0.5 to 0.8: stated 0.6, true 1 of 4: off by 0.35. Bin 0.95 to 1: stated 1, all true.
    diagram = diagram_of([(0.6, True)] + 3 * [(0.6, False)] + 6 * [(1.0, True)])
    assert diagram.error == pytest.approx(0.4 * 0.35)
    assert diagram.bins[1].stated == pytest.approx(0.6)
    assert diagram.bins[1].true.rate == 0.25
    assert (diagram.bins[1].true.low, diagram.bins[1].true.high) == wilson(1, 4)
    assert diagram.bins[0].stated is None


def test_honest_probabilities_have_a_small_calibration_error():
    # 4000 draws: the error of a bin's mean is 1 % or so, bins of 400 and more.
    random = np.random.default_rng(3)
    stated = random.uniform(0, 1, 4000)
    true = random.uniform(0, 1, 4000) < stated
    honest = diagram_of(zip(stated.tolist(), true.tolist(), strict=True)).error
    boasting = diagram_of(zip((stated**0.3).tolist(), true.tolist(), strict=True)).error
    assert honest < 0.02
    assert boasting > 0.15


def test_without_statements_there_is_no_error():
    assert (diagram_of([]).n, diagram_of([]).error) == (0, None)


@pytest.mark.parametrize("stated", [-0.01, 1.01, float("nan")])
def test_a_probability_outside_its_range_is_refused(stated):
    with pytest.raises(ValueError, match="outside 0 to 1"):
        diagram_of([(stated, True)])
