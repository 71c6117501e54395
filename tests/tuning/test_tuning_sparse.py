"""Normal equations of few lines: the way to the minimum, never where it is."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from tuning import STAGES, fit, fit_held_out, freedom
from tuning.fitting.stages import LAST
from tuning.misfit.misfit import Misfit, Sparse

WHOLE = replace(LAST, sparse=1)


@pytest.fixture(scope="module")
def fine(model, true_theta):
    return virtual_campaign(model, true_theta, noise=0.05, lines=800)


def test_few_lines_stand_for_all_of_them(model, fine, true_theta):
    varies = freedom(model, fine.tolerance)
    x = varies.coordinates(true_theta)
    problem, whole = LAST.problem(model, fine, varies), WHOLE.problem(model, fine, varies)
    assert isinstance(problem, Sparse)
    assert isinstance(whole, Misfit)
    assert problem.value(x) == whole.value(x)
    value, gradient, normal = problem.normal(x)
    assert value == whole(x)[0]
    assert gradient == pytest.approx(whole(x)[1], rel=1e-12)
    exact = whole.normal(x)[2].dense()
    # No line beside another counts for less than half of what the two do together.
    spread = np.linalg.eigvals(np.linalg.solve(exact, normal.dense())).real
    assert spread.min() > 0.5
    assert spread.max() < 2.0


def test_the_minimum_is_that_of_all_lines(model, fine, true_theta):
    found = [
        fit(model, fine, starts=(true_theta,), stages=(*STAGES[2:5], last))
        for last in (LAST, WHOLE)
    ]
    assert found[0].cost == pytest.approx(found[1].cost, rel=1e-7)
    assert found[0].theta == pytest.approx(found[1].theta, rel=1e-4)


def test_normal_equations_without_a_fold_are_those_of_the_other_lines(model, fine, true_theta):
    varies = freedom(model, fine.tolerance)
    x = varies.coordinates(true_theta)
    folds = (np.arange(800) // 40) % 5
    without = LAST.normals(model, fine, varies, x, folds)
    few = np.arange(800)[2::4]
    for fold, normal in enumerate(without):
        lines = few[folds[few] != fold]
        counted = np.isin(np.arange(800), lines)[few]
        alone = Misfit(model, fine.lines(few), varies, allowance=0.0, counted=counted)
        assert normal.dense() == pytest.approx(4 * alone.normal(x)[2].dense(), rel=1e-9, abs=1e-6)


def test_a_campaign_of_few_lines_counts_them_all(model, true_theta):
    coarse = virtual_campaign(model, true_theta, noise=0.05, lines=200)
    assert isinstance(LAST.problem(model, coarse, freedom(model, coarse.tolerance)), Misfit)


def test_held_out_fits_end_at_the_minima_of_their_lines(model, fine):
    found = fit(model, fine)
    held = fit_held_out(model, found, fine)
    for fold, theta in enumerate(held.thetas):
        kept = Misfit(model, fine, found.freedom, allowance=0.0, counted=held.folds != fold)
        x = found.freedom.coordinates(theta)
        _, gradient, normal = kept.normal(x)
        free = ~found.freedom.reached(x)
        whole = normal.dense() + np.diag(found.freedom.has_prior.astype(float))
        step = np.linalg.solve(whole[np.ix_(free, free)], gradient[free])
        assert 0.5 * gradient[free] @ step < 1.0  # nats, of which a campaign has thousands
