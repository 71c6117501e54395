"""The variance of FRF values against the scatter of simulated tests."""

import numpy as np
import pytest

from identification import coherence_variance, difference_variance


def simulated_tests(rng, *, trials, hits, response, noise, equal_hits):
    """H1 and ordinary coherence of each trial, from hits u and outputs y = H u + noise."""
    shape = (trials, hits)
    force = np.exp(2j * np.pi * rng.random(shape))
    if not equal_hits:
        force = force * rng.uniform(0.5, 1.5, shape)
    error = rng.normal(size=(2, *shape))
    output = response * force + noise * (error[0] + 1j * error[1]) / np.sqrt(2)
    cross = (output * force.conj()).sum(axis=1)
    power_in, power_out = ((abs(v) ** 2).sum(axis=1) for v in (force, output))
    return cross / power_in, abs(cross) ** 2 / (power_in * power_out)


@pytest.mark.parametrize("noise", [0.3, 1.0, 5.0])
@pytest.mark.parametrize("hits", [3, 10])
@pytest.mark.parametrize("equal_hits", [True, False], ids=["equal hits", "unequal hits"])
def test_coherence_predicts_the_scatter_of_h1(noise, hits, equal_hits):
    # The residual of the fit has 2 (n - 1) degrees of freedom, so the prediction is unbiased for
    # any hits. Of 8000 trials the scatter's own is 1.1 %, and it is 0.4 to 0.8 % of the mean
    # prediction: 5 % are four standard deviations.
    response = 2.0 - 1.5j
    rng = np.random.default_rng(int(10 * noise) + hits)
    h1, coherence = simulated_tests(
        rng, trials=8000, hits=hits, response=response, noise=noise, equal_hits=equal_hits
    )
    scatter = (abs(h1 - response) ** 2).mean()
    assert coherence_variance(h1, coherence, hits).mean() == pytest.approx(scatter, rel=0.05)


def test_more_averages_lower_the_variance_by_n_minus_one():
    values, coherence = np.array([1 + 2j, 3.0]), np.array([0.5, 0.8])
    ratio = coherence_variance(values, coherence, 3) / coherence_variance(values, coherence, 21)
    np.testing.assert_allclose(ratio, 10)


def test_the_variance_at_one_value_is_the_formula():
    # |3 + 4i|^2 (1 - 0.75) / (0.75 * 9)
    assert coherence_variance(np.array(3 + 4j), np.array(0.75), 10) == pytest.approx(25 / 27)


@pytest.mark.parametrize("coherence", [0.0, 1.0])
def test_coherence_at_its_ends_leaves_the_variance_finite_and_positive(coherence):
    variance = coherence_variance(np.array([2j]), np.array([coherence]), 10)
    assert np.isfinite(variance).all()
    assert (variance > 0).all()


def white(rng, shape, variance):
    parts = rng.normal(size=(2, *shape))
    return np.sqrt(variance / 2) * (parts[0] + 1j * parts[1])


def resonance(freq):
    """Receptance of one mode at 100 Hz, damping ratio 0.05: 40 lines across its width."""
    return 1 / (1 - (freq / 100) ** 2 + 0.1j * freq / 100)


FREQ = np.arange(1, 801) / 4


def test_differences_find_the_variance_of_white_noise():
    # 24 channels of 800 lines, each median over 31 correlated lines: about 40 of 800 lines are
    # independent, so the mean scatters by 5 %; 15 % leaves room for the bias of a short median.
    variance = np.geomspace(1e-4, 1e2, 24).reshape(6, 4)
    noise = white(np.random.default_rng(3), (800, 6, 4), variance)
    found = difference_variance(noise)
    assert found.shape == noise.shape
    assert (found / variance).mean() == pytest.approx(1, rel=0.15)


def test_differences_find_the_noise_on_a_resonance():
    variance = 1e-3
    noise = white(np.random.default_rng(4), (800, 24), variance)
    found = difference_variance(resonance(FREQ)[:, None] + noise)
    assert (found / variance).mean() == pytest.approx(1, rel=0.15)


def test_a_smooth_frf_has_next_to_no_variance():
    # Third difference at most 6 |H| (df / half width)^3 = 6 * 10 * (0.25 / 5)^3 = 0.0075.
    values = resonance(FREQ)
    found = difference_variance(values[:, None])
    assert found.max() <= 0.0075**2 / 20 / np.log(2)
    assert found.max() < 1e-6 * (abs(values) ** 2).max()


def test_a_parabola_has_no_variance():
    lines = np.arange(40.0)
    values = (3 - 1j) * lines**2 + 5 * lines + 2j
    np.testing.assert_allclose(difference_variance(values[:, None]), 0, atol=1e-20)


def test_differences_follow_noise_that_changes_along_frequency():
    rng = np.random.default_rng(5)
    variance = np.where(np.arange(800) < 400, 1.0, 100.0)[:, None]
    found = difference_variance(white(rng, (800, 50), variance))
    assert found[50:350].mean() == pytest.approx(1, rel=0.15)
    assert found[450:750].mean() == pytest.approx(100, rel=0.15)


def test_the_last_lines_are_weighed_as_any_others():
    # A filter that repeats the last difference has its one square as the last line's variance: that
    # line's noise then counts 5 to 10 times, and a mode at the end of the band explains it.
    noise = white(np.random.default_rng(9), (400, 300), 1.0)
    found = difference_variance(noise)
    weighed = (np.abs(noise) ** 2 / found).mean(axis=1)
    assert weighed[-20:] == pytest.approx(np.full(20, weighed[100:300].mean()), rel=0.25)
    np.testing.assert_array_equal(found[-15:], np.broadcast_to(found[-16], (15, 300)))


def test_one_outlier_does_not_raise_the_variance():
    noise = white(np.random.default_rng(6), (800, 50), 1.0)
    spoilt = noise.copy()
    spoilt[400] += 1e4  # spoils 4 of 31 differences
    ratio = difference_variance(spoilt).mean(axis=1) / difference_variance(noise).mean(axis=1)
    assert ratio.max() < 1.35  # the median of 31 moves by at most four places


def test_the_channels_do_not_mix():
    values = white(np.random.default_rng(7), (60, 3, 2), np.geomspace(1, 1e6, 6).reshape(3, 2))
    alone = difference_variance(values[:, 1:2, 1:])
    np.testing.assert_array_equal(difference_variance(values)[:, 1:2, 1:], alone)


@pytest.mark.parametrize("lines", [4, 5, 12, 33])
def test_short_tables_have_a_variance_at_every_line(lines):
    found = difference_variance(white(np.random.default_rng(8), (lines, 3), 1.0))
    assert found.shape == (lines, 3)
    assert (found > 0).all()


@pytest.mark.parametrize("lines", [0, 1, 3])
def test_fewer_than_four_lines_have_no_third_difference(lines):
    with pytest.raises(ValueError, match=f"{lines} lines are too few"):
        difference_variance(np.ones((lines, 2), complex))


def test_noise_that_rises_towards_zero_is_known_at_the_first_lines():
    rng = np.random.default_rng(12)
    freq = np.arange(801) * 0.25
    true = (1 + (3 / np.maximum(freq, 0.25)) ** 4)[:, None] * np.ones((801, 300))
    found = difference_variance(white(rng, true.shape, true))
    early = slice(1, 20)
    ratio = np.median(found[early], axis=1) / true[early, 0]
    assert (ratio > 0.3).all()
    assert (ratio < 30).all()
    late = np.median(found[40:], axis=1) / true[40:, 0]
    assert late == pytest.approx(1, abs=0.2)
