"""The error of a model beside the noise: closed forms, drawn errors, the fit at its own floor."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from identification.words import Campaign
from tuning import (
    STAGES,
    FloorSchedule,
    estimate_model_error,
    fit,
    fit_at_error_floor,
    parametrise,
    predict,
)
from tuning.misfit.residual_statistics import profile_floor
from tuning.misfit.weights import FORCE_ERROR_FLOOR


def with_model_error(campaign: Campaign, relative: float, seed: int) -> Campaign:
    """Multiply each point's motion by an error along a random direction, smooth in frequency."""
    random = np.random.default_rng(seed)
    tests = []
    for test in campaign.tests:
        frf = test.estimate.frf
        values = frf.values.copy()
        points = sorted({dof.point for dof in frf.outputs})
        for point in points:
            rows = [k for k, dof in enumerate(frf.outputs) if dof.point == point]
            size = np.linalg.norm(values[:, rows], axis=1, keepdims=True)
            error = random.normal(size=(*values[:, rows].shape, 2)) @ [1, 1j] / np.sqrt(2)
            values[:, rows] += relative * size * error
        estimate = replace(test.estimate, frf=replace(frf, values=values))
        tests.append(replace(test, estimate=estimate))
    return replace(campaign, tests=tuple(tests))


def test_without_noise_the_floor_is_the_root_mean_square():
    random = np.random.default_rng(1)
    power = np.exp(random.normal(size=4000))
    squares = 0.07**2 * power * random.exponential(size=4000)
    found = profile_floor(squares, np.zeros(4000), power)
    assert found.floor == pytest.approx(np.sqrt(np.mean(squares / power)), rel=2e-3)


def test_the_floor_has_the_largest_likelihood():
    random = np.random.default_rng(2)
    power, variance = np.exp(random.normal(size=(2, 3000)))
    squares = (variance + 0.5**2 * power) * random.exponential(size=3000)
    found = profile_floor(squares, variance, power)

    def cost(floor):
        total = variance + floor**2 * power
        return np.sum(squares / total + np.log(total))

    assert found.cost == pytest.approx(cost(found.floor))
    assert all(cost(found.floor * factor) > found.cost for factor in (0.97, 1.03))


def test_noise_alone_shows_the_force_sensors_error_at_most(model, true_theta):
    campaign = virtual_campaign(model, true_theta, noise=0.02, lines=400)
    found = estimate_model_error(predict(model, true_theta, campaign), campaign)
    # The noise of 18000 values hides a floor below a tenth of itself.
    assert found.floor < 0.004


@pytest.mark.parametrize("relative", [0.02, 0.1])
def test_a_drawn_error_is_found_beside_noise(model, true_theta, relative):
    clean = virtual_campaign(model, true_theta, noise=0.01, lines=300)
    campaign = with_model_error(clean, relative, seed=4)
    found = estimate_model_error(predict(model, true_theta, campaign), campaign)
    assert found.floor == pytest.approx(relative, rel=0.06)
    assert not found.is_at_force_error


def test_channels_that_do_not_move_tell_nothing(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    still = replace(
        campaign,
        tests=tuple(
            replace(
                test,
                estimate=replace(
                    test.estimate,
                    frf=replace(test.estimate.frf, values=0 * test.estimate.frf.values),
                ),
            )
            for test in campaign.tests
        ),
    )
    assert estimate_model_error(predict(model, true_theta, still), still) is None


def test_an_exact_model_is_fitted_down_to_its_noise(model, true_theta):
    campaign = virtual_campaign(model, true_theta, noise=0.01)
    found = fit_at_error_floor(model, campaign, parametrise(model, campaign.tolerance))
    np.testing.assert_allclose(found.fit.theta, true_theta, rtol=0.03)
    assert found.error.floor < 3e-3


def test_an_inexact_model_is_fitted_at_its_own_error(model, true_theta):
    clean = virtual_campaign(model, true_theta, noise=0.003)
    campaign = with_model_error(clean, 0.05, seed=5)
    found = fit_at_error_floor(model, campaign, parametrise(model, campaign.tolerance))
    assert found.is_settled
    assert found.error.floor == pytest.approx(0.05, rel=0.1)
    again = fit_at_error_floor(
        model,
        campaign,
        parametrise(model, campaign.tolerance),
        start=true_theta,
        floor=0.005,
    )
    assert again.error.floor == pytest.approx(found.error.floor, rel=0.02)


def test_a_fit_from_afar_begins_at_the_error_that_its_first_stages_leave(model, true_theta):
    """At the error of its start it would leave what the first stages reached."""
    campaign = virtual_campaign(model, true_theta, noise=0.01)
    fitted = fit_at_error_floor(
        model,
        campaign,
        parametrise(model, campaign.tolerance),
        start=1.2 * true_theta,
        first_stages=STAGES[:3],
        floor=0.5,
        schedule=FloorSchedule(max_turns=1),
    )
    assert fitted.fit.last_stage.model_error_floor < 0.05
    np.testing.assert_allclose(fitted.fit.theta, true_theta, rtol=0.03)


def test_first_stages_of_a_large_campaign_count_fewer_lines(model, true_theta, monkeypatch):
    campaign = virtual_campaign(model, true_theta, noise=0.01)
    strides = []

    def record_strides(*args, stages, **options):
        strides.append([stage.stride for stage in stages])
        return fit(*args, stages=stages, **options)

    monkeypatch.setattr("tuning.fitting.error_floor_fit.fit", record_strides)
    varies = parametrise(model, campaign.tolerance)
    fitted = fit_at_error_floor(
        model, campaign, varies, schedule=FloorSchedule(stride=16, first_stride_factor=2)
    )
    assert strides[0] == [*(2 * stage.stride for stage in STAGES[:3]), 16]
    assert all(later == [16] for later in strides[1:])
    np.testing.assert_allclose(fitted.fit.theta, true_theta, rtol=0.03)


def test_the_floor_never_falls_below_a_force_sensors_error():
    found = profile_floor(np.zeros(100), np.ones(100), np.ones(100))
    assert found.floor == pytest.approx(FORCE_ERROR_FLOOR, rel=3e-3)
    assert found.is_at_force_error
