"""Starts far from the truth find one minimum, by whatever algorithm the first stages go."""

import numpy as np
import pytest
from tuning_case import tuning_case

from mbmodel import load_machine
from tuning import Misfit, fit, parametrise

STARTS = range(8)


@pytest.fixture(scope="module")
def case(drawing):
    """Twelve parameters, 18 channels, three hits, 1 % noise."""
    return tuning_case(load_machine(drawing), 2, hit="acc3", points=6, highest_hz=165.0, lines=160)


@pytest.fixture(scope="module")
def parametrisation(case):
    return parametrise(case.model, case.campaign.tolerance)


@pytest.fixture(scope="module")
def ends(case, parametrisation):
    """Each start alone, so that each goes through all stages."""
    return [
        fit(case.model, case.campaign, parametrisation=parametrisation, starts=(case.start(seed),))
        for seed in STARTS
    ]


def test_all_starts_end_at_one_cost(ends):
    # It ends when a step promises less than 0.01 nats.
    costs = [end.cost for end in ends]
    assert max(costs) - min(costs) < 0.02
    assert all(end.converged for end in ends)


def test_that_cost_is_below_the_one_of_the_truth(case, parametrisation, ends):
    # Twelve parameters take about 6 of the nats that noise alone costs, and not hundreds.
    misfit = Misfit(case.model, case.campaign, parametrisation, model_error_floor=0.0)
    gained = misfit.value(parametrisation.coordinates(case.truth)) - ends[0].cost
    assert 1 < gained < 20


def test_all_starts_end_at_one_set_of_parameters_near_the_truth(case, ends):
    thetas = np.log([end.theta / case.truth for end in ends])
    assert np.ptp(thetas, axis=0).max() < 0.01
    assert np.median(np.abs(thetas)) < 0.005


@pytest.mark.parametrize("algorithm", ["LD_LBFGS", "LD_SLSQP", "LD_MMA", "LD_CCSAQ"])
def test_an_algorithm_of_nlopt_reaches_it_too(case, parametrisation, ends, algorithm):
    start = case.start(STARTS[0])
    result = fit(
        case.model,
        case.campaign,
        parametrisation=parametrisation,
        starts=(start,),
        algorithm=algorithm,
    )
    assert result.converged
    assert result.cost == pytest.approx(ends[0].cost, abs=0.02)


def test_the_same_start_gives_the_same_bits(case, parametrisation, ends):
    again = fit(
        case.model, case.campaign, parametrisation=parametrisation, starts=(case.start(STARTS[1]),)
    )
    assert np.array_equal(again.x, ends[1].x)
