"""The misfit at the centres of mass: against a twin that reduces, and against the channels."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import TOLERANCE
from test_tuning_misfit import answer, close, sizes, somewhere, weights

from tuning import STAGES, Misfit, fit, parametrise
from tuning.assessment.parameter_confidence import estimate_confidence


def reduced_twin(model, campaign, parametrisation, x, model_error_floor):
    """J, its gradient and N of residuals that are reduced and whitened body by body."""
    theta = parametrisation.theta(x)
    rates = np.zeros((len(theta), parametrisation.size))
    rates[parametrisation.free, parametrisation.coordinate_of[parametrisation.free]] = (
        parametrisation.rates(x)[parametrisation.free]
    )
    total = 0.5 * (parametrisation.precision * x**2).sum()
    gradient = parametrisation.precision * x
    normal = np.zeros((parametrisation.size, parametrisation.size))
    for test in campaign.tests:
        lines, frf = answer(model, theta, test), test.estimate.frf
        weight = weights(model, test, model_error_floor, logarithmic=False)[:, :, 0]
        jacobian = (lines.columns() @ rates)[:, :, 0]
        off = (lines.values - frf.values)[:, :, 0]
        rows = campaign.layout.rows(frf.outputs)
        for body in range(len(campaign.layout.bodies)):
            motion = rows[:, 6 * body : 6 * body + 6]
            here = motion.any(axis=1) & test.estimate.measured[:, 0]
            inverse = np.linalg.pinv(motion[here])
            known = np.isclose(np.diag(inverse @ motion[here]), 1.0)  # what they determine
            if not known.any():
                continue
            inverse = inverse[known]
            for line in np.flatnonzero(weight[:, here].all(axis=1)):
                covariance = inverse / weight[line, here] @ inverse.T
                white = np.linalg.inv(np.linalg.cholesky(covariance)) @ inverse
                r, columns = white @ off[line, here], white @ jacobian[line][here]
                total += np.vdot(r, r).real
                gradient += 2 * (columns.conj().T @ r).real
                normal += 2 * (columns.conj().T @ columns).real
    return total, gradient, normal


@pytest.mark.parametrize("model_error_floor", [0.03, 0.0])
def test_cost_gradient_and_normal_equations_are_those_of_reduced_residuals(
    whole, mixed, model_error_floor
):
    parametrisation = parametrise(whole, replace(TOLERANCE, sensor_delay=0.0))
    cost = Misfit(
        whole, mixed, parametrisation, model_error_floor=model_error_floor, at_bodies=True
    )
    x = somewhere(parametrisation)
    value, gradient, arrow = cost.quadratic_model(x)
    expected = reduced_twin(whole, mixed, parametrisation, x, model_error_floor)
    assert value == pytest.approx(expected[0], rel=1e-8)
    size = sizes(arrow)
    close(gradient, expected[1], size * np.sqrt(expected[0]), 1e-8)
    close(arrow.dense(), expected[2], np.outer(size, size), 1e-8)
    by_adjoint = cost(x)
    assert by_adjoint[0] == pytest.approx(cost.value(x), rel=1e-12) == pytest.approx(value)
    close(by_adjoint[1], gradient, size * np.sqrt(value), 1e-8)


def test_delays_between_the_channels_of_a_body_keep_the_gradient(whole, mixed, parametrisation):
    cost = Misfit(whole, mixed, parametrisation, model_error_floor=0.03, at_bodies=True)
    x = somewhere(parametrisation)
    value, gradient, arrow = cost.quadratic_model(x)
    expected = reduced_twin(whole, mixed, parametrisation, x, 0.03)
    size = sizes(arrow)
    close(cost(x)[1], expected[1], size * np.sqrt(value), 1e-8)
    # Directions whose weight is the square of a phase below 3e-5 are left out.
    close(gradient, expected[1], size * np.sqrt(value), 1e-4)
    close(arrow.dense(), expected[2], np.outer(size, size), 0.03)


def test_both_residuals_find_the_same_machine_within_their_intervals(model, campaign):
    parametrisation = parametrise(model, campaign.tolerance)
    stages = {
        at: tuple(replace(s, at_bodies=at == "bodies" and not s.logarithmic) for s in STAGES)
        for at in ("sensors", "bodies")
    }
    fits = [
        fit(model, campaign, parametrisation=parametrisation, stages=stages[at]) for at in stages
    ]
    confidences = [estimate_confidence(model, campaign, result) for result in fits]
    assert all(result.converged for result in fits)
    # The channels hold all that the bodies do: the difference has the difference of covariances.
    spread = confidences[1].covariance - confidences[0].covariance
    values, vectors = np.linalg.eigh(spread)
    assert values.min() > -1e-3 * values.max()
    known = values > 1e-3 * values.max()
    off = vectors[:, known].T @ (fits[1].x - fits[0].x)
    assert (off**2 / values[known]).sum() < known.sum() + 4 * np.sqrt(2 * known.sum())
    assert np.abs(fits[1].x - fits[0].x).max() > 0  # not the same sum under two names
