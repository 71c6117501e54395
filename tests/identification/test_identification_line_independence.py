"""Lines that share noise, by windows in time or averages along frequency."""

from dataclasses import replace

import numpy as np
import pytest

from identification import lines_are_independent
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

LINES = 600
FREQ = np.arange(40, 40 + LINES) * 0.25
OUTPUTS = tuple(Dof.parse(f"acc{k}:+t{axis}") for k in range(1, 5) for axis in "xyz")
HIT = Dof.parse("acc1:+tx")
LAYOUT = Layout(
    ("body",),
    np.zeros((1, 3)),
    tuple(f"acc{k}" for k in range(1, 5)),
    np.zeros(4, int),
    np.random.default_rng(0).normal(size=(4, 3)),
    np.tile(np.eye(3), (4, 1, 1)),
)


def noise(seed, window):
    """Spectra of white noise that a window weighs in time; (LINES, n_out)."""
    random = np.random.default_rng(seed)
    count = 4 * LINES
    record = random.normal(size=(2, count, len(OUTPUTS)))
    shape = window(np.arange(count) / count)[:, None]
    return np.fft.fft((record[0] + 1j * record[1]) * shape, axis=0)[:LINES] / np.sqrt(count)


def campaign(values):
    frf = Frf(FREQ, values[:, :, None], OUTPUTS, (HIT,), "accelerance")
    measured = np.ones((len(OUTPUTS), 1), bool)
    estimate = FrfEstimate(frf, np.ones(frf.values.shape), "differences", measured)
    return Campaign("moving", LAYOUT, (Test(Condition("drawn.uff", HIT), estimate),))


def mode(at_hz, damping, size):
    """An FRF with a mode, in all channels; (LINES, n_out)."""
    ratio = FREQ / at_hz
    gains = np.random.default_rng(1).normal(size=len(OUTPUTS))
    return size * (1 / (1 - ratio**2 + 2j * damping * ratio))[:, None] * gains


def block(time):
    return np.ones_like(time)


def hann(time):
    return np.sin(np.pi * time) ** 2


def falling(times):
    """To exp(-times) at the end of the block."""
    return lambda time: np.exp(-times * time)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [0.0, 3.0, 30.0])
def test_lines_of_a_block_have_noise_of_their_own(seed, size):
    assert lines_are_independent(campaign(noise(seed, block) + mode(90.0, 0.01, size)))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [3.0, 30.0])
@pytest.mark.parametrize("window", [hann, falling(4.0), falling(2.0)], ids=["Hann", "4", "2"])
def test_windows_make_neighbours_alike(seed, size, window):
    assert not lines_are_independent(campaign(noise(seed, window) + mode(90.0, 0.01, size)))


def test_a_window_that_hardly_falls_leaves_them_their_own():
    assert lines_are_independent(campaign(noise(3, falling(0.5)) + mode(90.0, 0.01, 3.0)))


def test_averages_along_frequency_make_neighbours_alike():
    values = noise(4, block)
    smooth = np.apply_along_axis(lambda one: np.convolve(one, np.ones(3) / 3, "same"), 0, values)
    assert not lines_are_independent(campaign(smooth))


def test_few_lines_and_still_channels_tell_nothing():
    assert not lines_are_independent(campaign(noise(5, block)).select_lines(slice(0, 50)))
    assert not lines_are_independent(campaign(noise(5, block)).select_lines(slice(0, 5)))
    still = campaign(np.zeros((LINES, len(OUTPUTS)), complex))
    assert not lines_are_independent(still)
    test = campaign(noise(5, block)).tests[0]
    dead = test.estimate.frf.values.copy()
    dead[:, 3] = 0.0
    estimate = replace(test.estimate, frf=replace(test.estimate.frf, values=dead))
    assert lines_are_independent(Campaign("x", LAYOUT, (replace(test, estimate=estimate),)))


def test_a_window_of_one_test_does_not_hide_among_the_others():
    plain = [noise(seed, block) + mode(90.0, 0.01, 30.0) for seed in range(4)]
    # Half as loud: the noisiest windows of all tests are those of the others.
    alike = 0.5 * noise(9, falling(4.0)) + mode(90.0, 0.01, 30.0)
    tests = [campaign(values).tests[0] for values in plain]
    assert lines_are_independent(Campaign("x", LAYOUT, tuple(tests)))
    assert not lines_are_independent(Campaign("x", LAYOUT, (*tests, campaign(alike).tests[0])))


@pytest.mark.parametrize(("times", "apart"), [(0.5, True), (1.2, False)])
def test_a_window_that_is_known_counts_as_such(times, apart):
    # Weaker than what the differences tell for sure.
    one = campaign(noise(6, falling(times)) + mode(90.0, 0.01, 3.0))
    (test,) = one.tests
    block_s = 1 / 0.25
    estimate = replace(test.estimate, window_tau=block_s / times)
    assert (
        lines_are_independent(Campaign("x", LAYOUT, (replace(test, estimate=estimate),))) is apart
    )
    assert lines_are_independent(one)
