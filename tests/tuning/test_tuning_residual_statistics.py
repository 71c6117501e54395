"""Statistics of residuals: independent values, noise share and floor against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from tuning import residual_statistics
from tuning.misfit.weights import FORCE_ERROR_FLOOR

LINES, CHANNELS, TESTS = 32, 18, 9
SHAPE = (LINES, CHANNELS, TESTS)
COUNT = LINES * CHANNELS * TESTS
DEVIATION = 0.01  # of the noise, where every FRF has the size one


def circular(random, shape=SHAPE):
    """Circular complex normal numbers of unit variance."""
    return random.normal(size=(*shape, 2)) @ [1, 1j] / np.sqrt(2)


def statistics_of(model, residual, deviation=DEVIATION):
    """The statistics of a residual beside FRFs of size one, three at each point."""
    freq = np.linspace(5.0, 165.0, LINES)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 7) for axis in range(3))
    measured = np.exp(2j * np.pi * np.random.default_rng(9).random(SHAPE))
    tests, predicted = [], []
    for number in range(TESTS):
        reference = Dof("acc3", "+tx")
        values = measured[:, :, number, None]
        variance = np.full(values.shape, deviation**2)
        frf = Frf(freq, values, outputs, (reference,), "accelerance")
        cells = np.ones((CHANNELS, 1), bool)
        estimate = FrfEstimate(frf, variance, "coherence", cells, averages=10, window_tau=0.0)
        tests.append(Test(Condition(f"{number}.uff", reference), estimate))
        predicted.append(values + residual[:, :, number, None])
    return residual_statistics(predicted, Campaign("virtual", model.machine.layout, tuple(tests)))


def test_all_values_of_white_noise_are_independent(model):
    noise = DEVIATION * circular(np.random.default_rng(1))
    statistics = statistics_of(model, noise)
    assert statistics.values == COUNT
    assert statistics.effective_values == pytest.approx(COUNT, rel=0.1)
    assert statistics.chi_square == pytest.approx(1.0, abs=0.05)
    assert statistics.floor == pytest.approx(FORCE_ERROR_FLOOR, rel=0.1)
    assert statistics.noise_share > 0.99


def test_a_residual_of_one_shape_holds_one_independent_value_or_little_more(model):
    random = np.random.default_rng(2)
    shapes = [np.exp(2j * np.pi * random.random(n)) for n in SHAPE]
    statistics = statistics_of(model, 0.05 * np.einsum("f,c,t->fct", *shapes))
    assert 1 <= statistics.effective_values < 2


@pytest.mark.parametrize("length", [2, 4, 8])
def test_of_blocks_of_equal_lines_each_block_counts_once(model, length):
    blocks = circular(np.random.default_rng(3), (LINES // length, CHANNELS, TESTS))
    statistics = statistics_of(model, 0.05 * np.repeat(blocks, length, axis=0))
    # Gram matrices of the other axes come from fewer independent columns: up to half is missing.
    assert 0.5 < statistics.effective_values / (COUNT / length) < 1.1


def test_channels_that_move_alike_count_once(model):
    bodies = circular(np.random.default_rng(4), (LINES, CHANNELS // 6, TESTS))
    statistics = statistics_of(model, 0.05 * np.repeat(bodies, 6, axis=1))
    assert 0.5 < statistics.effective_values / (COUNT / 6) < 1.1


@pytest.mark.parametrize("relative", [0.003, 0.03])
def test_the_floor_of_a_known_model_error_is_recovered_beside_noise(model, relative):
    random = np.random.default_rng(5)
    power = 3.0  # |H_point|^2: three directions of size one
    residual = DEVIATION * circular(random) + relative * np.sqrt(power) * circular(random)
    statistics = statistics_of(model, residual)
    assert statistics.floor == pytest.approx(relative, rel=0.1)
    share = DEVIATION**2 / (DEVIATION**2 + relative**2 * power)
    assert statistics.noise_share == pytest.approx(share, rel=0.1)
    total = DEVIATION**2 + relative**2 * power
    assert statistics.cost == pytest.approx(1 + np.log(total), abs=0.05)


def test_where_no_channel_moves_there_are_no_statistics(model):
    freq = np.linspace(5.0, 165.0, LINES)
    reference = Dof("acc3", "+tx")
    zero = np.zeros((LINES, 1, 1), complex)
    frf = Frf(freq, zero, (Dof("acc1", "+tx"),), (reference,), "accelerance")
    cells = np.ones((1, 1), bool)
    estimate = FrfEstimate(frf, np.ones(zero.shape), "coherence", cells, averages=10)
    test = Test(Condition("a.uff", reference), replace(estimate))
    campaign = Campaign("still", model.machine.layout, (test,))
    assert residual_statistics([zero], campaign) is None


def test_errors_below_the_least_of_a_force_sensor_are_no_gap_however_small_the_noise(model):
    shape = np.sqrt(3.0) * circular(np.random.default_rng(6))
    quiet = statistics_of(model, 0.5 * FORCE_ERROR_FLOOR * shape, deviation=1e-7)
    assert quiet.chi_square == pytest.approx(0.25, rel=0.05)
    gap = statistics_of(model, 10 * FORCE_ERROR_FLOOR * shape, deviation=1e-7)
    assert gap.chi_square == pytest.approx(100.0, rel=0.05)
