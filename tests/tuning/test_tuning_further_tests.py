"""Foreseen intervals are those that the further measurement then gives."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from identification.words import Campaign, Dof, distinct_dofs
from mbmodel import Model, hammer_parts
from tuning import Misfit, Session, build_toleranced_model, estimate_confidence, fit, parametrise
from tuning.assessment.further_tests import mean_channel_variance, predict_tests, rank_further_tests


@pytest.fixture(scope="module")
def one_direction(model, true_theta):
    """A test in x alone: what moves in y and z is badly seen."""
    whole = virtual_campaign(model, true_theta, lines=320)
    part = Campaign("x", whole.layout, whole.tests[:1])
    everything = build_toleranced_model(model.machine, part)
    parametrisation = parametrise(everything, part.tolerance)
    return whole, Session(None, everything, part, parametrisation)


@pytest.fixture(scope="module")
def gained(one_direction):
    _, session = one_direction
    result = fit(session.model, session.campaign, parametrisation=session.parametrisation)
    confidence = estimate_confidence(session.model, session.campaign, result)
    return result, confidence, rank_further_tests(session, confidence)


def test_every_point_that_was_not_hit_and_every_sensor_is_a_candidate(gained):
    _, _, gains = gained
    hammers = {gain.place for gain in gains if gain.what == "hammer"}
    sensors = {gain.place for gain in gains if gain.what == "sensor"}
    assert hammers == {"acc1", "acc2", "acc4", "acc5", "acc6"}
    assert sensors == {f"acc{k}" for k in range(1, 7)}


def test_no_further_measurement_makes_anything_worse(gained):
    _, confidence, gains = gained
    for gain in gains:
        assert gain.after <= gain.before * (1 + 1e-9)
        assert gain.shrink <= 1 + 1e-9
    worst = max(confidence.deviation[~confidence.parametrisation.is_tolerance])
    assert gains[0].before == pytest.approx(worst)


def test_the_most_telling_come_first(gained):
    _, _, gains = gained
    after = [round(gain.after, 3) for gain in gains]
    assert after == sorted(after)


def test_the_foreseen_interval_is_that_of_all_tests_together(one_direction, gained):
    # Both tests in one campaign, on all lines, instead of every eighth of the new one.
    _, session = one_direction
    result, confidence, gains = gained
    gain = next(gain for gain in gains if gain.what == "hammer")
    model, campaign = session.model, session.campaign
    directions = tuple(Dof.of(gain.place, axis) for axis in range(3))
    outputs = distinct_dofs(dof for test in campaign.tests for dof in test.estimate.frf.outputs)
    wider = Model(model.machine, (*model.parts, *hammer_parts(model.machine, directions)))
    noise = mean_channel_variance(campaign)
    usual = np.mean(list(noise.values()), axis=0)
    noise = {dof: noise.get(dof.positive, usual) for dof in outputs}
    theta = np.append(result.theta, wider.drawn[len(model.drawn) :])
    new = predict_tests(wider, theta, campaign, noise, directions).tests
    both = replace(campaign, tests=(*campaign.tests, *new))
    parametrisation = parametrise(wider, campaign.tolerance)
    x = parametrisation.coordinates(theta)
    whole = (
        Misfit(wider, both, parametrisation, model_error_floor=0.0).quadratic_model(x)[2].dense()
    )
    whole += np.diag(np.where(parametrisation.is_tolerance, 1.0, np.log(100) ** -2))
    place = parametrisation.names.index(gain.parameter)
    expected = np.sqrt(np.linalg.inv(whole)[place, place] * confidence.variance_inflation)
    assert gain.after == pytest.approx(expected, rel=0.1)
    assert gain.after < 0.9 * gain.before
