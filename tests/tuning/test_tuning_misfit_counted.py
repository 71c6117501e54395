"""Which values count in a misfit: dead and missing channels, rest, noise, allowances."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identification.words import Campaign
from tuning import Misfit, parametrise, predict
from tuning.misfit.weights import weight_batch


def somewhere(parametrisation, seed=21):
    """An x at which every parameter is off, not where the data come from."""
    x = np.random.default_rng(seed).normal(0.0, np.where(parametrisation.is_tolerance, 0.8, 0.2))
    return np.clip(x, -2, 2)


def test_squares_of_all_values_sum_to_the_cost_of_the_data(whole, mixed, parametrisation):
    x = somewhere(parametrisation)
    misfit = Misfit(whole, mixed, parametrisation, model_error_floor=0.0)
    squares = misfit.squared_residuals(x)
    assert squares.shape == (misfit.values,)
    assert squares.sum() == pytest.approx(misfit.value(x) - misfit.prior(x), rel=1e-12)
    with pytest.raises(ValueError, match="differences at the channels"):
        Misfit(
            whole, mixed, parametrisation, model_error_floor=0.0, logarithmic=True
        ).squared_residuals(x)


def test_misfits_of_one_campaign_share_its_values_and_keep_their_own_weights(
    whole, mixed, parametrisation
):
    x, lines = somewhere(parametrisation), len(mixed.freq_hz)
    cases = [(0.0, None), (0.1, None), (0.0, np.arange(lines) % 2 == 0), (0.1, None)]

    def cost(campaign, floor, counted):
        misfit = Misfit(whole, campaign, parametrisation, model_error_floor=floor, counted=counted)
        return misfit, misfit.value(x)

    shared = [cost(mixed, *case) for case in cases]
    # A copy of the campaign keeps nothing of those before.
    assert [value for _, value in shared] == [cost(replace(mixed), *case)[1] for case in cases]
    assert len({value for _, value in shared}) == 3
    first, *others = (misfit.batches[0].batch.values for misfit, _ in shared)
    assert all(np.shares_memory(values, first) for values in others)


def without(test, row):
    """The test without a channel."""
    estimate = test.estimate
    rows = [k for k in range(len(estimate.frf.outputs)) if k != row]
    frf = estimate.frf.select([estimate.frf.outputs[k] for k in rows], estimate.frf.inputs)
    cut = replace(
        estimate, frf=frf, variance=estimate.variance[:, rows], measured=estimate.measured[rows]
    )
    return replace(test, estimate=cut)


def silenced(test, row, *, measured):
    """The test with a channel of zeros, as a cable that was not plugged in gives."""
    estimate = test.estimate
    values, variance = estimate.frf.values.copy(), estimate.variance.copy()
    mask = estimate.measured.copy()
    values[:, row], variance[:, row], mask[row] = 0.0, 0.0, measured
    changed = replace(
        estimate, frf=replace(estimate.frf, values=values), variance=variance, measured=mask
    )
    return replace(test, estimate=changed)


@pytest.mark.parametrize("logarithmic", [True, False])
@pytest.mark.parametrize("measured", [False, True], ids=["masked", "dead"])
def test_a_channel_that_holds_nothing_does_not_count(
    whole, mixed, parametrisation, logarithmic, measured
):
    x, row = somewhere(parametrisation), 7
    first, *rest = mixed.tests
    lost = replace(mixed, tests=(without(first, row), *rest))
    silent = replace(mixed, tests=(silenced(first, row, measured=measured), *rest))
    single, second = (
        Misfit(whole, campaign, parametrisation, model_error_floor=0.0, logarithmic=logarithmic)
        for campaign in (lost, silent)
    )
    assert single.values == second.values
    assert second.value(x) == pytest.approx(single.value(x), rel=1e-12)


def shifted(campaign, hz) -> Campaign:
    tests = []
    for test in campaign.tests:
        frf = replace(test.estimate.frf, freq_hz=test.estimate.frf.freq_hz + hz)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf)))
    return replace(campaign, tests=tuple(tests))


@pytest.mark.parametrize("logarithmic", [True, False])
def test_the_line_at_rest_does_not_count(model, campaign, logarithmic):
    # Measured accelerance at 0 Hz is noise, the model's is zero and has no logarithm.
    at_rest = shifted(campaign, -5.0)
    assert at_rest.freq_hz[0] == 0
    parametrisation = parametrise(model, campaign.tolerance)
    x = somewhere(parametrisation)
    single, second = (
        Misfit(
            model, some, parametrisation, model_error_floor=0.1, logarithmic=logarithmic
        ).quadratic_model(x)
        for some in (at_rest, at_rest.select_lines(slice(1, None)))
    )
    assert single[0] == pytest.approx(second[0], rel=1e-12)
    np.testing.assert_allclose(single[1], second[1], rtol=1e-9)
    np.testing.assert_allclose(
        single[2].dense(), second[2].dense(), rtol=1e-9, atol=1e-9 * single[0]
    )


def test_a_large_allowance_weighs_every_point_by_its_motion_alone(whole, mixed, parametrisation):
    # Noise of 3 % is nothing beside an allowance of 30: the cost falls with its square.
    x = somewhere(parametrisation)
    wide, wider = (Misfit(whole, mixed, parametrisation, model_error_floor=a) for a in (30.0, 60.0))
    data = [cost.value(x) - cost.prior(x) for cost in (wide, wider)]
    assert data[0] == pytest.approx(4 * data[1], rel=1e-3)


def test_a_prediction_answers_in_the_labels_of_the_test(model, campaign, flip):
    straight, turned = (predict(model, model.drawn, some) for some in (campaign, flip(campaign)))
    assert turned[0][:, 0] == pytest.approx(straight[0][:, 0])  # channel and hammer both turned
    assert turned[0][:, 1:] == pytest.approx(-straight[0][:, 1:])
    assert turned[1] == pytest.approx(straight[1])


def test_the_logarithm_of_values_near_the_noise_does_not_count(model, campaign):
    parametrisation = parametrise(model, campaign.tolerance)

    def at(first):
        """The campaign with a signal to noise of 100 from some line on, of 4.5 before."""
        tests = []
        for test in campaign.tests:
            estimate = test.estimate
            variance = np.abs(estimate.frf.values) ** 2 / 1e4
            variance[:first] *= 1e4 / 20
            known = replace(estimate, variance=variance, variance_source="differences")
            tests.append(replace(test, estimate=known))
        return replace(campaign, tests=tuple(tests))

    def values(tests, *, logarithmic):
        return Misfit(
            model, tests, parametrisation, model_error_floor=0.1, logarithmic=logarithmic
        ).values

    assert values(at(20), logarithmic=False) == values(at(0), logarithmic=False)
    heard = values(at(0).select_lines(slice(20, None)), logarithmic=True)
    assert values(at(20), logarithmic=True) == heard < values(at(0), logarithmic=True)


def left_over(model, campaign, theta, add) -> Campaign:
    """Measurements from which the model is off by something, in units of the noise."""
    tests = []
    for test, values in zip(campaign.tests, predict(model, theta, campaign), strict=True):
        size = np.abs(values).max(axis=0) / 100
        frf = replace(test.estimate.frf, values=values - size * add(values.shape))
        variance = np.broadcast_to(size**2, values.shape)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf, variance=variance)))
    return replace(campaign, tests=tuple(tests))


def fitted(campaign):
    """Every other line: pairs an odd number of lines apart count."""
    return np.arange(len(campaign.freq_hz)) % 2 == 0


def test_what_neighbouring_lines_share_is_the_error_and_not_the_noise(model, campaign):
    parametrisation, random = parametrise(model, campaign.tolerance), np.random.default_rng(31)
    x = somewhere(parametrisation)

    def scatter(shape):
        # Twice as large as is stated.
        return 2 * (random.normal(size=shape) + 1j * random.normal(size=shape)) / np.sqrt(2)

    def smooth(shape):
        return 0.7 * np.exp(0.1j * np.arange(shape[0]))[:, None, None] * np.ones(shape)

    def serial(add, lags):
        made = left_over(model, campaign, parametrisation.theta(x), add)
        misfit = Misfit(model, made, parametrisation, model_error_floor=0.0)
        return misfit.serial_covariance(x, lags, fitted(made)), misfit.squared_residuals(x)

    noise, squares = serial(scatter, (3, 5))
    assert squares.mean() == pytest.approx(4.0, rel=0.1)
    assert abs(noise) < 4 * 4.0 / np.sqrt(2 * 2 * squares.size) + 0.02
    error, squares = serial(smooth, (3, 5))
    of_lags = 0.49 * np.cos(0.1 * np.array([3, 5]))
    # Fewer pairs of lines are far apart; a floor of 3e-4 of the motion is noise as well.
    assert error == pytest.approx(of_lags.mean(), rel=2e-2)
    both, _ = serial(lambda shape: smooth(shape) + scatter(shape), (3, 5))
    assert both == pytest.approx(error, abs=0.06)


def test_what_lines_share_is_summed_over_pairs_that_both_count(whole, mixed, parametrisation):
    x = somewhere(parametrisation)
    misfit = Misfit(whole, mixed, parametrisation, model_error_floor=0.0)
    shared, count, seen = 0.0, 0, np.arange(len(mixed.freq_hz)) % 4 == 2
    for test, values in zip(
        mixed.tests, predict(whole, parametrisation.theta(x), mixed), strict=True
    ):
        single = Misfit(
            whole, replace(mixed, tests=(test,)), parametrisation, model_error_floor=0.0
        )
        estimate = test.estimate
        (term,) = single._terms
        off = (values - estimate.frf.values)[:, :, 0]
        for lag in (1, 3):
            for first in range(len(off) - lag):
                if seen[first] == seen[first + lag]:
                    continue
                for row in range(off.shape[1]):
                    here, there = term.weight[[first, first + lag], row, 0]
                    if here > 0 and there > 0:
                        count += 1
                        pair = off[first, row].conjugate() * off[first + lag, row]
                        shared += pair.real * np.sqrt(here * there)
    assert misfit.serial_covariance(x, (1, 3), seen) == pytest.approx(shared / count, rel=1e-9)
    assert misfit.serial_covariance(x, (len(mixed.freq_hz),), seen) is None
    assert misfit.serial_covariance(x, (4, 8), seen) is None
    with pytest.raises(ValueError, match="differences at the channels"):
        Misfit(
            whole, mixed, parametrisation, model_error_floor=0.0, logarithmic=True
        ).serial_covariance(x, (1,), seen)


@pytest.mark.parametrize(("ratio", "counts"), [(1e-9, False), (1e-4, True)])
def test_a_channel_that_moves_by_the_error_of_the_modal_form_has_no_logarithm(
    whole, mixed, parametrisation, ratio, counts
):
    # On a symmetric machine the modal form leaves 1e-10 of the largest channel, or exactly zero.
    misfit = Misfit(whole, mixed, parametrisation, model_error_floor=0.1, logarithmic=True)
    batch, real = misfit._terms[0].batch, misfit._terms[0].batch.evaluator

    def at(theta):
        values = real.at(theta).values.copy()
        values[:, 0] *= ratio * np.abs(values).max() / np.abs(values[:, 0]).max()
        return SimpleNamespace(values=values)

    symmetric = SimpleNamespace(request=real.request, model=real.model, at=at)
    every = np.ones(len(mixed.freq_hz), bool)
    weight = weight_batch(replace(batch, evaluator=symmetric), 0.1, True, every).weight
    assert (weight[:, 0] > 0).any() == counts
    np.testing.assert_array_equal(weight[:, 1:], misfit._terms[0].weight[:, 1:])
