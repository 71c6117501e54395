"""Fits recover what made the data, from any start, and say how they ended."""

import numpy as np
import pytest
from small_machine import virtual_campaign

from tuning import LogCost, Stage, fit, random_starts


@pytest.fixture(scope="module")
def fitted(model, campaign):
    return fit(model, campaign)


def test_the_fit_recovers_the_parameters_that_made_the_data(fitted, true_theta):
    # 1 % noise on 160 lines of some 20 channels: most parameters to a part in a thousand; the
    # least visible damping to a few per cent.
    error = np.abs(np.log(fitted.theta / true_theta))
    assert np.median(error) < 0.005
    assert error.max() < 0.1
    assert fitted.converged
    assert not fitted.at_bound.any()


def test_the_last_cost_is_that_of_noise_alone(model, fitted, true_theta, campaign):
    at_truth = LogCost(model, campaign, 0.03)(true_theta)[0]
    assert fitted.cost == pytest.approx(at_truth, rel=0.02)
    assert fitted.cost <= at_truth


def test_random_starts_find_the_same_minimum_and_say_which_did_not(model, campaign, fitted):
    # One of these four ends in a second minimum: its cost is told, and the best start is kept.
    found = fit(model, campaign, starts=random_starts(model, 4, seed=3))
    assert len(found.costs) == 4
    assert found.agree == sum(cost < 1.02 * min(found.costs) for cost in found.costs) >= 3
    assert found.cost == min(found.costs)
    assert found.theta == pytest.approx(fitted.theta, rel=0.02)


def test_random_starts_are_the_drawing_and_then_its_multiples(model):
    starts = random_starts(model, 3, seed=3)
    assert starts[0] == pytest.approx(model.drawn)
    assert all((start > 0).all() for start in starts)
    assert not np.allclose(starts[1], starts[2])
    assert random_starts(model, 3, seed=3)[2] == pytest.approx(starts[2])


def test_exact_data_are_fitted_exactly(model, true_theta):
    exact = virtual_campaign(model, true_theta, noise=1e-6)
    stages = (Stage(0.5, 4), Stage(0.1), Stage(0.01))
    found = fit(model, exact, stages=stages)
    assert found.theta == pytest.approx(true_theta, rel=0.01)


def test_an_interrupt_in_the_middle_keeps_the_best_parameters(model, campaign):
    def interrupt(step):
        if step.stage == 1 and step.evaluation == 3:
            raise KeyboardInterrupt

    found = fit(model, campaign, report=interrupt)
    assert found.outcome == "interrupted"
    assert not found.converged
    first_stage = fit(model, campaign, stages=(Stage(0.5, 4),))
    last = LogCost(model, campaign, 0.03)
    assert last(found.theta)[0] < last(model.drawn)[0]
    assert last(found.theta)[0] < 3 * last(first_stage.theta)[0]
