"""The misfit at the centres of mass: against a twin that reduces, and against the channels."""

import numpy as np
import pytest
from test_tuning_misfit import answer, close, sizes, somewhere, weights

from tuning import Misfit, fit, freedom, stages_of
from tuning.assessment.parameter_confidence import confidence


def reduced_twin(model, campaign, varies, x, allowance):
    """J, its gradient and N of residuals that are reduced and whitened body by body."""
    theta = varies.theta(x)
    rates = np.zeros((len(theta), varies.size))
    rates[varies.free, varies.member[varies.free]] = varies.rates(x)[varies.free]
    total = 0.5 * (x[varies.has_prior] ** 2).sum()
    gradient = np.where(varies.has_prior, x, 0.0)
    normal = np.zeros((varies.size, varies.size))
    for test in campaign.tests:
        lines, frf = answer(model, theta, test), test.estimate.frf
        weight = weights(model, test, allowance, logarithmic=False)[:, :, 0]
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


@pytest.mark.parametrize("allowance", [0.03, 0.0])
def test_cost_gradient_and_normal_equations_are_those_of_reduced_residuals(
    whole, mixed, varies, allowance
):
    cost = Misfit(whole, mixed, varies, allowance=allowance, at_bodies=True)
    x = somewhere(varies)
    value, gradient, arrow = cost.normal(x)
    expected = reduced_twin(whole, mixed, varies, x, allowance)
    assert value == pytest.approx(expected[0], rel=1e-8)
    size = sizes(arrow)
    close(gradient, expected[1], size * np.sqrt(expected[0]), 1e-8)
    close(arrow.dense(), expected[2], np.outer(size, size), 1e-8)
    by_adjoint = cost(x)
    assert by_adjoint[0] == pytest.approx(cost.value(x), rel=1e-12) == pytest.approx(value)
    close(by_adjoint[1], gradient, size * np.sqrt(value), 1e-8)


def test_both_residuals_find_the_same_machine_within_their_intervals(model, campaign):
    varies = freedom(model, campaign.tolerance)
    fits = [
        fit(model, campaign, varies=varies, stages=stages_of(("log",), at))
        for at in ("sensors", "bodies")
    ]
    sures = [confidence(model, campaign, one) for one in fits]
    assert all(one.converged for one in fits)
    # The channels hold all that the bodies do: the difference has the difference of covariances.
    spread = sures[1].covariance - sures[0].covariance
    values, vectors = np.linalg.eigh(spread)
    assert values.min() > -1e-3 * values.max()
    known = values > 1e-3 * values.max()
    off = vectors[:, known].T @ (fits[1].x - fits[0].x)
    assert (off**2 / values[known]).sum() < known.sum() + 4 * np.sqrt(2 * known.sum())
    assert np.abs(fits[1].x - fits[0].x).max() > 0  # not the same sum under two names
