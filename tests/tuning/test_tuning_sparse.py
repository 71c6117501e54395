"""Normal equations of few lines: the way to the minimum, never where it is."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from tuning import STAGES, fit, fit_held_out, parametrise
from tuning.fitting.stage_search import LAST_STAGE, minimise_stage
from tuning.misfit.misfit import Misfit
from tuning.misfit.sparse_misfit import SparseMisfit
from tuning.solvers.gauss_newton import Box, gauss_newton

WHOLE = replace(LAST_STAGE, normal_stride=1)


@pytest.fixture(scope="module")
def fine(model, true_theta):
    return virtual_campaign(model, true_theta, noise=0.05, lines=800)


def test_few_lines_stand_for_all_of_them(model, fine, true_theta):
    parametrisation = parametrise(model, fine.tolerance)
    x = parametrisation.coordinates(true_theta)
    problem, whole = (
        LAST_STAGE.build_problem(model, fine, parametrisation),
        WHOLE.build_problem(model, fine, parametrisation),
    )
    assert isinstance(problem, SparseMisfit)
    assert isinstance(whole, Misfit)
    assert problem.value(x) == whole.value(x)
    value, gradient, normal = problem.quadratic_model(x)
    assert value == whole(x)[0]
    assert gradient == pytest.approx(whole(x)[1], rel=1e-12)
    exact = whole.quadratic_model(x)[2].dense()
    # No line beside another counts for less than half of what the two do together.
    spread = np.linalg.eigvals(np.linalg.solve(exact, normal.dense())).real
    assert spread.min() > 0.5
    assert spread.max() < 2.0


def test_the_minimum_is_that_of_all_lines(model, fine, true_theta):
    result = [
        fit(model, fine, starts=(true_theta,), stages=(*STAGES[2:5], last))
        for last in (LAST_STAGE, WHOLE)
    ]
    assert result[0].cost == pytest.approx(result[1].cost, rel=1e-7)
    assert result[0].theta == pytest.approx(result[1].theta, rel=1e-4)


def test_normal_equations_without_a_fold_are_those_of_the_other_lines(model, fine, true_theta):
    parametrisation = parametrise(model, fine.tolerance)
    x = parametrisation.coordinates(true_theta)
    folds = (np.arange(800) // 40) % 5
    without = LAST_STAGE.leave_out_normals(model, fine, parametrisation, x, folds)
    few = np.arange(800)[2::4]
    for fold, normal in enumerate(without):
        lines = few[folds[few] != fold]
        counted = np.isin(np.arange(800), lines)[few]
        alone = Misfit(
            model, fine.select_lines(few), parametrisation, model_error_floor=0.0, counted=counted
        )
        assert normal.dense() == pytest.approx(
            4 * alone.quadratic_model(x)[2].dense(), rel=1e-9, abs=1e-6
        )


def test_a_campaign_of_few_lines_counts_them_all(model, true_theta):
    coarse = virtual_campaign(model, true_theta, noise=0.05, lines=200)
    assert isinstance(
        LAST_STAGE.build_problem(model, coarse, parametrise(model, coarse.tolerance)), Misfit
    )


def test_held_out_fits_end_at_the_minima_of_their_lines(model, fine):
    result = fit(model, fine)
    held = fit_held_out(model, result, fine)
    for fold, theta in enumerate(held.thetas):
        kept = Misfit(
            model, fine, result.parametrisation, model_error_floor=0.0, counted=held.folds != fold
        )
        x = result.parametrisation.coordinates(theta)
        _, gradient, normal = kept.quadratic_model(x)
        free = ~result.parametrisation.coordinates_at_bound(x)
        whole = normal.dense() + np.diag(result.parametrisation.is_tolerance.astype(float))
        step = np.linalg.solve(whole[np.ix_(free, free)], gradient[free])
        assert 0.5 * gradient[free] @ step < 1.0  # nats, of which a campaign has thousands


def test_normal_equations_of_few_lines_do_not_end_a_search_beside_a_narrow_mode(model, true_theta):
    damping = np.array([p.name.endswith(".damping") for p in model.parameters])
    narrow = np.where(damping, 0.02 * true_theta, true_theta)
    campaign = virtual_campaign(model, narrow, noise=0.05, lines=600)
    parametrisation = parametrise(model, campaign.tolerance)
    start = parametrisation.coordinates(narrow * np.where(damping, 1.5, 1.002))
    few = LAST_STAGE.build_problem(model, campaign, parametrisation)
    assert isinstance(few, SparseMisfit)
    box = Box(
        parametrisation.lower,
        parametrisation.upper,
        parametrisation.is_tolerance.astype(float),
        np.full(parametrisation.size, np.inf),
    )
    whole = gauss_newton(few.whole, start, box, tolerance=1e-8, exact_curvature=True)
    alone = gauss_newton(few, start, box, tolerance=1e-8)
    end = minimise_stage(few, parametrisation, start, LAST_STAGE)
    assert end.outcome == "converged"
    assert end.value < whole.value + 2.0
    assert alone.value > end.value + 100.0
