"""The complex-log cost and its gradient."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from tuning import LogCost, predict


def _difference(cost, theta, parameter):
    # Central differences: with a step of 1e-5 the truncation is 1e-10, the rounding of J 1e-10.
    step = 1e-5 * theta[parameter]
    up, down = theta.copy(), theta.copy()
    up[parameter] += step
    down[parameter] -= step
    return (cost(up)[0] - cost(down)[0]) / (2 * step)


def test_the_gradient_is_the_difference_quotient_of_the_cost(model, campaign):
    cost = LogCost(model, campaign, 0.1)
    _, gradient = cost(model.drawn)
    numeric = [_difference(cost, model.drawn, p) for p in range(len(model.drawn))]
    assert gradient * model.drawn == pytest.approx(
        np.array(numeric) * model.drawn, rel=1e-5, abs=1e-7 * np.abs(gradient * model.drawn).max()
    )


def test_the_gradient_holds_where_tests_have_windows_of_their_own(model, true_theta):
    campaign = virtual_campaign(model, true_theta, taus=(0.4, 0.0, 0.4))
    cost = LogCost(model, campaign, 0.1)
    _, gradient = cost(model.drawn)
    for parameter in (0, 5, 9):
        assert gradient[parameter] == pytest.approx(
            _difference(cost, model.drawn, parameter), rel=1e-5
        )


def test_the_cost_is_the_weighted_mean_square_of_the_complex_logarithm(model, campaign):
    # The definition, value by value, as a slow twin.
    allowance = 0.2
    total, count = 0.0, 0
    predicted = predict(model, model.drawn, campaign)
    for answer, test in zip(predicted, campaign.tests, strict=True):
        frf = test.estimate.frf
        for k in range(len(frf.freq_hz)):
            for row, dof in enumerate(frf.outputs):
                same = [i for i, other in enumerate(frf.outputs) if other.point == dof.point]
                power = sum(abs(frf.values[k, i, 0]) ** 2 for i in same)
                measured = frf.values[k, row, 0]
                residual = np.log(answer[k, row, 0] / measured)
                variance = test.estimate.variance[k, row, 0] + allowance**2 * power
                total += abs(residual) ** 2 * abs(measured) ** 2 / variance
                count += 1
    assert LogCost(model, campaign, allowance)(model.drawn)[0] == pytest.approx(
        total / (2 * count), rel=1e-12
    )


def test_the_cost_vanishes_at_the_truth_of_noiseless_data(model, true_theta):
    exact = virtual_campaign(model, true_theta, noise=0.0)
    assert LogCost(model, exact, 0.1)(true_theta)[0] < 1e-20


def test_the_line_at_rest_does_not_count(model, campaign):
    # Measured accelerance at 0 Hz is noise, the model's is zero and has no logarithm.
    tests = tuple(
        replace(
            test,
            estimate=replace(
                test.estimate,
                frf=replace(test.estimate.frf, freq_hz=test.estimate.frf.freq_hz - 5.0),
            ),
        )
        for test in campaign.tests
    )
    shifted = replace(campaign, tests=tests)
    assert shifted.freq_hz[0] == 0
    whole = LogCost(model, shifted, 0.1)(model.drawn)
    without = LogCost(model, shifted.lines(slice(1, None)), 0.1)(model.drawn)
    assert whole[0] == pytest.approx(without[0], rel=1e-12)
    assert whole[1] == pytest.approx(without[1], rel=1e-9)


def test_turned_signs_of_channels_and_hammer_change_nothing(model, campaign, flip):
    straight = LogCost(model, campaign, 0.1)(model.drawn)
    turned = LogCost(model, flip(campaign), 0.1)(model.drawn)
    assert turned[0] == pytest.approx(straight[0], rel=1e-12)
    assert turned[1] == pytest.approx(straight[1], rel=1e-9)


def test_a_prediction_answers_in_the_labels_of_the_test(model, campaign, flip):
    straight, turned = (
        predict(model, model.drawn, campaign),
        predict(model, model.drawn, flip(campaign)),
    )
    assert turned[0][:, 0] == pytest.approx(straight[0][:, 0])  # channel and hammer both turned
    assert turned[0][:, 1:] == pytest.approx(-straight[0][:, 1:])
    assert turned[1] == pytest.approx(straight[1])
