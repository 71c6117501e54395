"""Confidence in a plant: nothing is added to a true model; what a model lacks widens its bands."""

from dataclasses import replace

import numpy as np
import pytest

from mbmodel import FrfRequest, linearise, load_machine
from tests.helpers.plant_coverage import plant_coverage
from tests.helpers.tuning_case import tuning_case
from truth import Plan, Protocol
from truth.machine.random_tree import draw_tree
from tuning import estimate_confidence, fit
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.assessment.plant_confidence import estimate_plant_confidence
from tuning.fitting.stage_search import LAST_STAGE

MACHINES, FIRST = 2, 72_300
KINDS = ("magnitude", "phase")


def coverage(dirt):
    rows = []
    for seed in range(FIRST, FIRST + MACHINES):
        tree = draw_tree(seed, 3)
        protocol = Protocol((tree.first_aim(),), lines=121, resolution_hz=1.5)
        rows.append(plant_coverage(tree, Plan(seed, protocol=protocol, dirt=dirt)))
    held = [[row[kind][0] / row[kind][1] for kind in KINDS] for row in rows]
    return rows, np.mean(held)


def test_clean_machines_have_bands_of_their_parameters_alone():
    rows, held = coverage(0.0)
    assert sum(row["discrepancy"] > 0 for row in rows) <= 1
    assert held > 0.85  # two machines alone; the bench has more
    assert all(row["magnitude"][2] < 0.05 for row in rows)


def test_what_the_model_lacks_is_held_by_the_bands():
    rows, held = coverage(5.0)
    assert all(row["discrepancy"] > 1e-4 for row in rows)
    assert held >= 0.85
    assert all(row["magnitude"][2] < 1.0 for row in rows)


@pytest.fixture(scope="module")
def case(drawing):
    return tuning_case(load_machine(drawing), 3, hit="acc3", points=6, lines=161, noise=1e-3)


def with_discrepancy(case, error, seed):
    """Return the campaign with an error of each value, drawn by the discrepancy of the model."""
    rng, tests = np.random.default_rng(seed), []
    for test in case.campaign.tests:
        frf = test.estimate.frf
        request = FrfRequest(frf.freq_hz, frf.outputs, frf.inputs, frf.quantity)
        deviation = discrepancy_motion(linearise(case.model, case.truth, request))
        drawn = rng.standard_normal((2, *deviation.shape)) / np.sqrt(2)
        values = frf.values + error * deviation * (drawn[0] + 1j * drawn[1])
        tests.append(
            replace(test, estimate=replace(test.estimate, frf=replace(frf, values=values)))
        )
    return replace(case.campaign, tests=tuple(tests))


def confidence_at_truth(case, campaign):
    """Return both confidences at the true parameters, without a fit."""
    still = fit(case.model, campaign, starts=(case.truth,), stages=())
    confidence = estimate_confidence(case.model, campaign, still)
    return confidence, estimate_plant_confidence(case.model, campaign, still, confidence)


@pytest.mark.parametrize("error", [2e-3, 2e-2])
def test_the_discrepancy_that_made_the_data_is_found(case, error):
    confidence, plant = confidence_at_truth(case, with_discrepancy(case, error, seed=8))
    assert plant.discrepancy == pytest.approx(error, rel=0.05)
    assert (
        np.diag(plant.covariance) > np.diag(confidence.covariance) / confidence.chi_square
    ).all()


def test_data_without_discrepancy_leave_the_covariance_of_the_noise(case):
    confidence, plant = confidence_at_truth(case, case.campaign)
    assert plant.discrepancy == 0
    assert np.array_equal(plant.covariance, confidence.covariance)


def test_the_covariance_is_that_of_fits_to_data_that_are_drawn_again(case):
    # Independent errors at every value: the Gauss-Newton step from the truth is the estimate.
    error, steps = 1e-3, []
    parametrisation = fit(case.model, case.campaign, stages=()).parametrisation
    x = parametrisation.coordinates(case.truth)
    _, plant = confidence_at_truth(case, with_discrepancy(case, error, seed=9))
    for seed in range(60):
        problem = LAST_STAGE.build_misfit(
            case.model, with_discrepancy(case, error, seed), parametrisation
        )
        _, gradient, normal = problem.quadratic_model(x)
        steps.append(np.linalg.solve(normal.dense(), -gradient))
    ratio = np.std(steps, axis=0) / np.sqrt(np.diag(plant.covariance))
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)
    assert (ratio < 1.4).all()
