"""The misfit, its gradient by two ways, and its normal equations, against twins written out."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from mbmodel import Evaluator, FrfRequest, Model
from mbmodel.parts import JointPart
from tuning import Misfit, UserSpecification, parametrise
from tuning.misfit import accumulation

# What varies: sensors have blocks of their own unless they are tied to others or within.
WISHES = {
    "all": UserSpecification(),
    "legs tied": UserSpecification(
        ties=[["base_t?.stiffness"], ["head_t?.damping", "base_tx.damping"]]
    ),
    "sensors tied": UserSpecification(ties=[["acc1.gain_x", "acc4.gain_x"], ["acc?.rotation_z"]]),
    "one sensor tied": UserSpecification(ties=[["acc3.gain_?"], ["base.mass", "head.mass"]]),
    "blocks of different sizes": UserSpecification(
        fix=["acc1.position_?", "acc2.*", "acc6.gain_y"]
    ),
    "no sensor": UserSpecification(fix=["acc*"], free=["base.joint_rotation_?"]),
}
KINDS = [(0.2, True), (0.0, True), (0.03, False), (0.0, False)]


@pytest.fixture(scope="module", params=WISHES, ids=lambda name: name.replace(" ", "-"))
def wished(request, whole, mixed):
    return request.param, parametrise(whole, mixed.tolerance, WISHES[request.param])


def somewhere(parametrisation, seed=21):
    """An x at which every parameter is off, not where the data come from."""
    x = np.random.default_rng(seed).normal(0.0, np.where(parametrisation.is_tolerance, 0.8, 0.2))
    return np.clip(x, -2, 2)


def weights(model, test, model_error_floor, logarithmic):
    """1 / (var + a^2 |H_point|^2), value by value; zero where nothing counts."""
    estimate, frf = test.estimate, test.estimate.frf
    drawn = answer(model, model.drawn, test).values
    result = np.zeros(frf.values.shape)
    for line, row in np.ndindex(result.shape[:2]):
        dof = frf.outputs[row]
        same = [k for k, d in enumerate(frf.outputs)
                if d.point == dof.point and d.is_rotation == dof.is_rotation]  # fmt: skip
        power = sum(abs(frf.values[line, k, 0]) ** 2 for k in same)
        variance = estimate.variance[line, row, 0] + max(model_error_floor, 3e-4) ** 2 * power
        still = np.abs(drawn[:, row]).max() <= 1e-10 * np.abs(drawn).max()
        near = abs(frf.values[line, row, 0]) ** 2 <= 25 * estimate.variance[line, row, 0]
        if estimate.measured[row, 0] and not (logarithmic and (still or near)):
            result[line, row, 0] = 1 / variance
    return result


def answer(model, theta, test):
    """One test alone, in its own labels."""
    estimate, frf = test.estimate, test.estimate.frf
    question = FrfRequest(
        frf.freq_hz, frf.outputs, frf.inputs, frf.quantity, window_tau=estimate.window_tau
    )
    return Evaluator(model, question, condition=test.condition).at(theta)


def twin(model, campaign, parametrisation, x, model_error_floor, logarithmic):
    """J, its gradient and N from columns of all parameters, test by test."""
    theta = parametrisation.theta(x)
    rates = np.zeros((len(theta), parametrisation.size))
    rates[parametrisation.free, parametrisation.coordinate_of[parametrisation.free]] = (
        parametrisation.rates(x)[parametrisation.free]
    )
    total = 0.5 * (parametrisation.precision * x**2).sum()
    gradient = parametrisation.precision * x
    normal = np.zeros((parametrisation.size, parametrisation.size))
    for test in campaign.tests:
        lines, measured = answer(model, theta, test), test.estimate.frf.values
        weight = weights(model, test, model_error_floor, logarithmic)
        counts = weight > 0
        columns = (lines.columns() @ rates)[counts]
        off, slope = (lines.values - measured)[counts], np.ones(counts.sum())
        if logarithmic:
            size = np.abs(measured[counts])
            off = size * np.log(lines.values[counts] / measured[counts])
            slope = size / lines.values[counts]
        jacobian = slope[:, None] * columns
        weighted = jacobian.conj() * weight[counts][:, None]
        total += (weight[counts] * np.abs(off) ** 2).sum()
        gradient += 2 * (weighted.T @ off).real
        normal += 2 * (weighted.T @ jacobian).real
    return total, gradient, normal


def sizes(arrow):
    """Size of each coordinate; those that nothing sees count as one."""
    diagonal = arrow.diagonal()
    return np.sqrt(np.where(diagonal > 1e-12 * diagonal.max(), diagonal, 1.0))


def close(result, expected, size, tolerance=1e-9):
    """Each entry relative to the size of its coordinates."""
    np.testing.assert_allclose(result / size, expected / size, rtol=0, atol=tolerance)


@pytest.mark.parametrize(("model_error_floor", "logarithmic"), KINDS)
def test_cost_gradient_and_normal_equations_are_those_of_the_twin(
    whole, mixed, wished, model_error_floor, logarithmic
):
    _, parametrisation = wished
    cost = Misfit(
        whole, mixed, parametrisation, model_error_floor=model_error_floor, logarithmic=logarithmic
    )
    x = somewhere(parametrisation)
    value, gradient, arrow = cost.quadratic_model(x)
    expected = twin(whole, mixed, parametrisation, x, model_error_floor, logarithmic)
    assert value == pytest.approx(expected[0], rel=1e-9)
    size = sizes(arrow)
    close(gradient, expected[1], size * np.sqrt(expected[0]))
    close(arrow.dense(), expected[2], np.outer(size, size))


def test_coordinates_in_another_order_than_parameters_are_the_same_misfit(
    whole, mixed, parametrisation
):
    # Those of joints, which stand in the middle, come last.
    some = Model(whole.machine, tuple(p for p in whole.parts if not isinstance(p, JointPart)))
    second = parametrise(some, mixed.tolerance).extend(parametrisation)
    order = [parametrisation.names.index(name) for name in second.names]
    assert order != sorted(order)
    x = somewhere(parametrisation)
    value, gradient, arrow = Misfit(
        whole, mixed, parametrisation, model_error_floor=0.05
    ).quadratic_model(x)
    result = Misfit(whole, mixed, second, model_error_floor=0.05).quadratic_model(x[order])
    assert result[0] == pytest.approx(value, rel=1e-12)
    size = sizes(arrow)[order]
    close(result[1], gradient[order], size * np.sqrt(value))
    close(result[2].dense(), arrow.dense()[np.ix_(order, order)], np.outer(size, size))


@pytest.mark.parametrize(("model_error_floor", "logarithmic"), KINDS)
def test_value_adjoint_and_normal_equations_agree(
    whole, mixed, wished, model_error_floor, logarithmic
):
    _, parametrisation = wished
    cost = Misfit(
        whole, mixed, parametrisation, model_error_floor=model_error_floor, logarithmic=logarithmic
    )
    for seed in (22, 23):
        x = somewhere(parametrisation, seed)
        by_adjoint, by_columns = cost(x), cost.quadratic_model(x)
        assert by_adjoint[0] == pytest.approx(cost.value(x), rel=1e-12)
        assert by_columns[0] == pytest.approx(cost.value(x), rel=1e-12)
        size = sizes(by_columns[2]) * np.sqrt(by_columns[0])
        close(by_adjoint[1], by_columns[1], size)


@pytest.mark.parametrize("logarithmic", [True, False])
def test_the_gradient_is_the_difference_quotient_of_the_cost(
    whole, mixed, parametrisation, logarithmic
):
    # Fourth order: a step of 3e-4 leaves 1e-10 of truncation and less of rounding.
    cost = Misfit(whole, mixed, parametrisation, model_error_floor=0.05, logarithmic=logarithmic)
    x, step = somewhere(parametrisation), 3e-4
    value, gradient = cost(x)
    some = np.arange(0, parametrisation.size, 2)
    quotient = np.zeros(parametrisation.size)
    for k in some:
        unit = step * (np.arange(parametrisation.size) == k)
        near, far = (cost.value(x + m * unit) - cost.value(x - m * unit) for m in (1, 2))
        quotient[k] = (8 * near - far) / (12 * step)
    size = sizes(cost.quadratic_model(x)[2]) * np.sqrt(value)
    close(gradient[some], quotient[some], size[some], 3e-8)


def test_every_sensor_has_a_block_unless_something_ties_it(whole, mixed, wished):
    name, parametrisation = wished
    arrow = Misfit(whole, mixed, parametrisation, model_error_floor=0.1).quadratic_model(
        somewhere(parametrisation)
    )[2]
    blocks = {
        "all": [15] * 6,
        "legs tied": [15] * 6,
        "sensors tied": [],  # one rotation of all
        "one sensor tied": [15] * 5,
        "blocks of different sizes": [12, 15, 15, 15, 14],
        "no sensor": [],
    }[name]
    assert (arrow.block_coordinates >= 0).sum(axis=1).tolist() == blocks
    assert len(arrow.shared_coordinates) == parametrisation.size - sum(blocks)
    own_rows = arrow.block_coordinates[arrow.block_coordinates >= 0]
    assert sorted([*own_rows, *arrow.shared_coordinates]) == list(range(parametrisation.size))


def test_sensors_alone_may_vary(whole, mixed):
    parametrisation = parametrise(
        whole, mixed.tolerance, UserSpecification(fix=["base*", "head*", "hammer*", "acc5.*"])
    )
    x = somewhere(parametrisation)
    value, gradient, arrow = Misfit(
        whole, mixed, parametrisation, model_error_floor=0.1
    ).quadratic_model(x)
    expected = twin(whole, mixed, parametrisation, x, 0.1, False)
    assert value == pytest.approx(expected[0], rel=1e-9)
    assert arrow.block_coordinates.shape == (5, 15)
    size = sizes(arrow)
    close(gradient, expected[1], size * np.sqrt(value))
    close(arrow.dense(), expected[2], np.outer(size, size))


@pytest.mark.parametrize("chunk", [1, 40_000])
def test_how_many_lines_are_held_at_once_does_not_matter(whole, mixed, wished, monkeypatch, chunk):
    _, parametrisation = wished
    cost, x = (
        Misfit(whole, mixed, parametrisation, model_error_floor=0.1, logarithmic=True),
        somewhere(parametrisation),
    )
    at_once = cost.quadratic_model(x)
    monkeypatch.setattr(accumulation, "MAX_JACOBIAN_VALUES", chunk)
    piecewise = cost.quadratic_model(x)
    size = sizes(at_once[2])
    assert piecewise[0] == at_once[0]
    close(piecewise[1], at_once[1], size * np.sqrt(at_once[0]), 1e-13)
    close(piecewise[2].dense(), at_once[2].dense(), np.outer(size, size), 1e-13)


@pytest.mark.parametrize("logarithmic", [True, False])
def test_all_lines_but_a_fold_are_those_of_a_misfit_that_never_saw_it(
    whole, mixed, wished, logarithmic
):
    _, parametrisation = wished
    x, n_freq = somewhere(parametrisation), len(mixed.freq_hz)
    folds = np.arange(n_freq) // 5 % 3
    cost = Misfit(whole, mixed, parametrisation, model_error_floor=0.05, logarithmic=logarithmic)
    all_lines, *without = cost.quadratic_models_by_fold(x, folds)
    assert len(without) == 3
    assert all_lines[0] == pytest.approx(cost.quadratic_model(x)[0], rel=1e-12)
    size = sizes(all_lines[2])
    for fold, (value, gradient, arrow) in enumerate(without):
        kept = Misfit(
            whole,
            mixed,
            parametrisation,
            model_error_floor=0.05,
            logarithmic=logarithmic,
            counted=folds != fold,
        )
        assert kept.values < cost.values
        expected = kept.quadratic_model(x)
        assert value == pytest.approx(expected[0], rel=1e-10)
        close(gradient, expected[1], size * np.sqrt(value), 1e-12)
        close(arrow.dense(), expected[2].dense(), np.outer(size, size), 1e-12)


def test_a_prior_counts_half_its_square_and_stays_out_of_the_normal_equations(whole, mixed):
    wishes = UserSpecification(free=["head.mass", "acc3.position_y"])
    priors, none = (parametrise(whole, mixed.tolerance, w) for w in (None, wishes))
    scale = np.array([mixed.tolerance.mass, mixed.tolerance.sensor_position])
    places = [priors.names.index(name) for name in wishes.free]
    x = somewhere(priors)
    free_x = x.copy()
    free_x[places] *= scale
    with_prior, without = (
        Misfit(whole, mixed, parametrisation, model_error_floor=0.1)
        for parametrisation in (priors, none)
    )
    lost = 0.5 * (x[places] ** 2).sum()
    assert with_prior.prior(x) == pytest.approx(0.5 * (priors.precision * x**2).sum())
    assert with_prior.value(x) - without.value(free_x) == pytest.approx(lost, rel=1e-6)
    first, second = with_prior.quadratic_model(x), without.quadratic_model(free_x)
    expected = first[1][places] - second[1][places] * scale
    np.testing.assert_allclose(expected, x[places], rtol=1e-6)
    np.testing.assert_allclose(
        first[2].diagonal()[places], second[2].diagonal()[places] * scale**2, rtol=1e-9
    )


def test_the_misfit_of_noise_alone_is_the_number_of_values(model, true_theta):
    # 7200 values, each |error|^2 / var is exponential of mean 1: their sum is known to 1.2 %.
    campaign = virtual_campaign(model, true_theta, noise=0.1)
    parametrisation = parametrise(model, campaign.tolerance)
    cost = Misfit(model, campaign, parametrisation, model_error_floor=0.0)
    assert cost.values == sum(test.estimate.frf.values.size for test in campaign.tests) == 7200
    value = cost.value(parametrisation.coordinates(true_theta))
    assert value == pytest.approx(cost.values, rel=0.04)


@pytest.mark.parametrize("logarithmic", [True, False])
def test_the_misfit_vanishes_at_the_truth_of_noiseless_data(model, true_theta, logarithmic):
    exact = virtual_campaign(model, true_theta, noise=0.0)
    parametrisation = parametrise(model, exact.tolerance)
    cost = Misfit(model, exact, parametrisation, model_error_floor=0.1, logarithmic=logarithmic)
    x = parametrisation.coordinates(true_theta)
    value, gradient = cost(x)
    assert value - cost.prior(x) < 1e-15
    assert np.abs(gradient - parametrisation.precision * x).max() < 1e-6


def test_of_small_errors_the_logarithm_is_the_difference(model, true_theta):
    exact = virtual_campaign(model, true_theta, noise=0.0)
    parametrisation = parametrise(model, exact.tolerance)
    x = parametrisation.coordinates(true_theta) + 1e-5 * np.arange(parametrisation.size)
    by_log, by_difference = (
        Misfit(
            model, exact, parametrisation, model_error_floor=0.1, logarithmic=way
        ).quadratic_model(x)
        for way in (True, False)
    )
    assert by_log[0] == pytest.approx(by_difference[0], rel=0.01)
    np.testing.assert_allclose(by_log[2].diagonal(), by_difference[2].diagonal(), rtol=0.01)


@pytest.mark.parametrize("logarithmic", [True, False])
def test_turned_signs_of_channels_and_hammer_change_nothing(
    whole, mixed, parametrisation, flip, logarithmic
):
    x = somewhere(parametrisation)
    straight, turned = (
        Misfit(
            whole, campaign, parametrisation, model_error_floor=0.1, logarithmic=logarithmic
        ).quadratic_model(x)
        for campaign in (mixed, flip(mixed))
    )
    size = sizes(straight[2])
    assert turned[0] == pytest.approx(straight[0], rel=1e-12)
    close(turned[1], straight[1], size * np.sqrt(straight[0]))
    close(turned[2].dense(), straight[2].dense(), np.outer(size, size))


@pytest.mark.parametrize("logarithmic", [True, False])
def test_the_order_of_tests_and_channels_does_not_matter(
    whole, mixed, parametrisation, logarithmic
):
    x, tests = somewhere(parametrisation), []
    for number, test in enumerate(mixed.tests[::-1]):
        estimate = test.estimate
        order = np.random.default_rng(number).permutation(len(estimate.frf.outputs))
        frf = estimate.frf.select([estimate.frf.outputs[k] for k in order], estimate.frf.inputs)
        variance, measured = estimate.variance[:, order], estimate.measured[order]
        mixed_up = replace(estimate, frf=frf, variance=variance, measured=measured)
        tests.append(replace(test, estimate=mixed_up))
    first, second = (
        Misfit(
            whole, campaign, parametrisation, model_error_floor=0.1, logarithmic=logarithmic
        ).quadratic_model(x)
        for campaign in (mixed, replace(mixed, tests=tuple(tests)))
    )
    size = sizes(first[2])
    assert second[0] == pytest.approx(first[0], rel=1e-12)
    close(second[1], first[1], size * np.sqrt(first[0]))
    close(second[2].dense(), first[2].dense(), np.outer(size, size))


def test_a_model_is_linearised_once_for_its_value_and_its_derivatives(
    whole, mixed, wished, monkeypatch
):
    _, parametrisation = wished
    cost = Misfit(whole, mixed, parametrisation, model_error_floor=0.1)
    x = somewhere(parametrisation)
    expected = Misfit(whole, mixed, parametrisation, model_error_floor=0.1).quadratic_model(x)
    calls = []
    linearise = Evaluator.at

    def count(evaluator, theta):
        calls.append(theta)
        return linearise(evaluator, theta)

    monkeypatch.setattr(Evaluator, "at", count)
    batches = len(cost.batches)
    value = cost.value(x)
    cost.value(0.9 * x)
    assert len(calls) == 2 * batches
    again, gradient, normal = cost.quadratic_model(x)
    assert len(calls) == 2 * batches
    assert again == expected[0] == pytest.approx(value, rel=1e-13)
    np.testing.assert_array_equal(gradient, expected[1])
    np.testing.assert_array_equal(normal.dense(), expected[2].dense())
    cost.value(1.1 * x)
    assert cost.quadratic_model(0.9 * x)[0] == pytest.approx(cost(0.9 * x)[0], rel=1e-13)
    assert len(calls) == 3 * batches
    assert cost(x)[0] == pytest.approx(expected[0], rel=1e-13)
    assert len(calls) == 4 * batches
