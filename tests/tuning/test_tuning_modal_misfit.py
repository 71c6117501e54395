"""The modal cost: its definition, its gradient, its pairs, and what a search from it finds."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from small_machine import virtual_campaign

from identification.modal import mac
from identification.words import Dof, UsageError
from mbmodel import modes_of_matrices, shapes_at
from tuning import (
    STAGES,
    Misfit,
    Stage,
    fit,
    modes_in_band,
    parametrise,
    random_starts,
    select_modes,
    select_stages,
)
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalCost, ModalStage

STAGE = ModalStage(0.05, 0.3)


@pytest.fixture(scope="module")
def last(model, campaign):
    """The misfit of theta with an allowance of 3 %."""
    parametrisation = parametrise(model, campaign.tolerance)
    cost = Misfit(model, campaign, parametrisation, model_error_floor=0.03, logarithmic=True)
    return lambda theta: cost.value(parametrisation.coordinates(theta))


@pytest.fixture(scope="module")
def measured(campaign):
    return modes_in_band(campaign)


def test_the_modes_in_the_band_are_those_of_the_machine(model, true_theta, measured):
    expected = modes_of_matrices(model.matrices(true_theta)).freq_hz
    assert len(measured.poles) == 5  # the sixth lies above the band
    np.testing.assert_allclose(np.sort(measured.freq_hz), expected[:5], rtol=2e-4)
    assert measured.shapes.shape == (len(measured.outputs), 5)


def test_the_cost_is_its_definition_written_out(model, measured):
    # Pairs by the least sum over all assignments, modes one by one, as a slow twin.
    result = modes_of_matrices(model.matrices(model.drawn))
    shapes = shapes_at(model, model.drawn, result, measured.outputs)
    criterion = mac(measured.shapes, shapes)
    cost = np.zeros(criterion.shape)
    for r in range(cost.shape[0]):
        for q in range(cost.shape[1]):
            freq = np.log(result.freq_hz[q] / measured.freq_hz[r])
            damping = np.log(result.damping[q] / measured.damping[r])
            sd = measured.freq_sd[r] / measured.freq_hz[r]
            sd_damping = measured.damping_sd[r] / measured.damping[r]
            cost[r, q] = 0.5 * (
                freq**2 / (sd**2 + 0.05**2)
                + damping**2 / (sd_damping**2 + 0.3**2)
                + (1 - criterion[r, q]) / 0.05**2
            )
    best = min(
        sum(cost[r, q] for r, q in enumerate(order))
        for order in permutations(range(cost.shape[1]), cost.shape[0])
    )
    assert ModalCost(model, measured, STAGE)(model.drawn)[0] == pytest.approx(best / 5, rel=1e-12)


def differences(cost, theta, step=1e-4):
    """Fourth-order central differences by log theta."""
    columns = []
    for k in range(len(theta)):

        def at(scale, k=k):
            moved = theta.copy()
            moved[k] *= 1 + scale * step
            return cost(moved)[0]

        columns.append((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step))
    return np.array(columns)


@pytest.mark.parametrize("stage", [*MODAL_STAGES, STAGE])
def test_the_gradient_is_the_difference_quotient_of_the_cost(model, measured, stage):
    for theta in random_starts(model, 4, seed=7):
        cost = ModalCost(model, measured, stage).start_at(model.drawn)
        expected = differences(cost, theta)
        result = cost(theta)[1] * theta
        np.testing.assert_allclose(result, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_the_cost_vanishes_where_the_model_is_what_was_measured(model, true_theta, campaign):
    exact = modes_in_band(virtual_campaign(model, true_theta, noise=1e-6))
    value, gradient = ModalCost(model, exact, STAGE)(true_theta)
    assert value < 1e-6
    assert np.abs(gradient * true_theta).max() < 1e-2


def test_size_and_phase_of_measured_shapes_do_not_count(model, measured):
    factor = np.exp(1j * np.arange(5)) * (1 + np.arange(5))
    changed = replace(measured, shapes=measured.shapes * factor)
    first, second = (ModalCost(model, m, STAGE)(model.drawn) for m in (measured, changed))
    assert first[0] == pytest.approx(second[0], rel=1e-12)
    np.testing.assert_allclose(first[1], second[1], rtol=1e-9)


def with_stranger(measured):
    """One measured mode more, with a shape of no mode of the model."""
    shape = np.random.default_rng(1).choice([-1.0, 1.0], (len(measured.outputs), 1))
    return replace(
        measured,
        poles=np.append(measured.poles, 2 * np.pi * 60 * (-0.01 + 1j)),
        shapes=np.hstack([measured.shapes, shape]),
        participation=np.hstack([measured.participation, measured.participation[:, :1]]),
        freq_sd=np.append(measured.freq_sd, 0.01),
        damping_sd=np.append(measured.damping_sd, 1e-4),
    )


def test_pairs_are_one_to_one_and_a_stranger_has_none(model, true_theta, measured):
    pairs = ModalCost(model, with_stranger(measured), MODAL_STAGES[-1]).pairs(true_theta)
    assert pairs.partner[-1] == -1
    assert pairs.mac[-1] == 0
    result = pairs.partner[:-1]
    assert sorted(result) == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(pairs.freq_hz[result], measured.freq_hz, rtol=1e-3)
    assert (pairs.mac[:-1] > 0.99).all()


def test_a_mode_without_partner_costs_what_it_costs_and_moves_nothing(model, true_theta, measured):
    theta = true_theta * 1.1
    stage = MODAL_STAGES[-1]
    alone = ModalCost(model, measured, stage).start_at(theta)
    beside = ModalCost(model, with_stranger(measured), stage).start_at(theta)
    first, second = alone(theta), beside(theta)
    lost = stage.edge / (2 * stage.model_error_floor**2)
    assert second[0] == pytest.approx((5 * first[0] + lost) / 6, rel=1e-12)
    np.testing.assert_allclose(second[1], first[1] * 5 / 6, rtol=1e-12)


def test_what_no_mode_sees_stays_where_the_search_began(model, campaign, measured):
    # One mode alone tells little of twelve parameters.
    lowest = select_modes(measured, np.arange(5) == 0, np.ones(len(measured.outputs), bool))
    result = fit(model, campaign, stages=MODAL_STAGES, measured=lowest)
    assert result.converged
    assert np.abs(np.log(result.theta / model.drawn)).max() < 1.0
    pairs = ModalCost(model, lowest, MODAL_STAGES[-1]).pairs(result.theta)
    assert pairs.freq_hz[pairs.partner[0]] == pytest.approx(lowest.freq_hz[0], rel=1e-3)


def test_the_cost_goes_on_where_two_modes_pass_each_other(model, measured):
    # Along this way through the parameters, modes of the model change their order.
    ends = random_starts(model, 3, seed=7)[1:]
    cost = ModalCost(model, measured, STAGE)
    for share in np.linspace(0, 1, 60):
        theta = ends[0] ** (1 - share) * ends[1] ** share
        value, gradient = cost(theta)
        way = np.log(ends[1] / ends[0]) * 1e-7
        step = cost(theta * np.exp(way))[0] - value
        assert abs(step) < 1e-3 * abs(value) + 3 * abs(gradient * theta @ way)


def test_random_starts_reach_the_minimum_of_the_frfs_by_modes_alone(
    model, true_theta, campaign, measured, last
):
    starts = random_starts(model, 9, seed=11)[1:]
    result = fit(model, campaign, starts=starts, stages=MODAL_STAGES, measured=measured)
    assert result.agreeing_starts >= 7
    assert last(result.theta) < 1.05 * last(true_theta)


def test_starts_twice_as_far_off_reach_it_by_modes_and_then_frfs(model, true_theta, campaign, last):
    measured = modes_in_band(campaign)
    starts = random_starts(model, 9, seed=8, spread=1.0)[1:]
    stages = (*MODAL_STAGES, Stage(0.03))
    best = last(true_theta)
    costs = fit(model, campaign, starts=starts, stages=stages, measured=measured).start_costs
    # Of 40 such starts 38 do, of FRFs alone 33.
    assert sum(cost < 1.05 * best for cost in costs) >= 6


def test_the_search_is_no_further_than_30_percent_stiffness_and_50_percent_damping(
    model, true_theta, campaign, measured, last
):
    rng = np.random.default_rng(4)
    size = np.where([p.name.endswith("damping") for p in model.parameters], 0.5, 0.3)
    best = last(true_theta)
    for _ in range(3):
        start = true_theta * (1 + size * rng.choice([-1, 1], len(size)))
        result = fit(model, campaign, starts=(start,), stages=MODAL_STAGES, measured=measured)
        assert last(result.theta) < 1.05 * best


def test_stages_follow_the_residuals_in_order():
    assert select_stages(("modal", "log")) == (*MODAL_STAGES, *STAGES[1:3])
    assert select_stages(("modal",)) == MODAL_STAGES
    assert select_stages(("log",)) == STAGES[:3]


def test_channels_that_the_model_cannot_move_do_not_count(model, measured):
    still = Dof.parse("acc1:+ty")  # the base has no joint along y
    assert still not in measured.outputs
    changed = replace(
        measured,
        outputs=(*measured.outputs, still),
        shapes=np.vstack([measured.shapes, 5 * np.ones((1, 5))]),
        lower=np.vstack([measured.lower, measured.lower[:1]]),
        upper=np.vstack([measured.upper, measured.upper[:1]]),
    )
    first, second = (ModalCost(model, m, STAGE)(model.drawn)[0] for m in (measured, changed))
    assert first == pytest.approx(second, rel=1e-9)


def test_no_mode_and_no_measurement_are_refused(model, campaign, measured):
    none = select_modes(measured, np.zeros(5, bool), np.ones(len(measured.outputs), bool))
    with pytest.raises(UsageError, match="no mode"):
        ModalCost(model, none, STAGE)
    with pytest.raises(UsageError, match="measured modes"):
        fit(model, campaign, stages=MODAL_STAGES)


def test_of_a_roving_hammer_the_shapes_are_where_it_hit(model, true_theta, campaign, measured):
    # The same machine measured the other way round, by reciprocity: three sensors, many hits.
    tests = []
    for row, dof in enumerate(campaign.tests[0].estimate.frf.outputs):
        places = [t.estimate.frf.outputs.index(dof) if dof in t.estimate.frf.outputs else None
                  for t in campaign.tests]  # fmt: skip
        if None in places or row % 2:
            continue
        estimates = [t.estimate for t in campaign.tests]
        values = np.stack(
            [e.frf.values[:, k, 0] * t.condition.reference.sign
             for e, k, t in zip(estimates, places, campaign.tests, strict=True)], axis=1
        )[:, :, None]  # fmt: skip
        outputs = tuple(t.condition.reference.positive for t in campaign.tests)
        frf = replace(estimates[0].frf, values=values, outputs=outputs, inputs=(dof,))
        variance = np.stack(
            [e.variance[:, k, 0] for e, k in zip(estimates, places, strict=True)], axis=1
        )[:, :, None]
        estimate = replace(
            estimates[0], frf=frf, variance=variance, measured=np.ones((len(outputs), 1), bool)
        )
        tests.append(
            replace(
                campaign.tests[0],
                condition=replace(campaign.tests[0].condition, reference=dof),
                estimate=estimate,
            )
        )
    assert len(tests) > 3
    roved = modes_in_band(replace(campaign, tests=tuple(tests)))
    assert len(roved.outputs) == len(tests)
    pairs = ModalCost(model, roved, MODAL_STAGES[-1]).pairs(true_theta)
    assert (pairs.partner >= 0).all()
    assert (pairs.mac > 0.98).all()
