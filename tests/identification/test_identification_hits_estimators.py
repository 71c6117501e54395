"""H1, H2, Hv: their biases, their variance, their order, against spectra drawn from known noise."""

import numpy as np
import pytest

from identification.hits import average_spectra, estimate_frf
from identification.noise.variance import coherence_variance

LINES = 4000
H = np.array([2.0 - 1.0j, -0.3 + 0.7j])


def drawn(n, force_noise, motion_noise, seed=5):
    """Spectra of n hits of unequal strength and phase; noise powers relative to unit force."""
    rng = np.random.default_rng(seed)

    def normal(*shape):
        return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)

    strength = rng.uniform(0.7, 1.3, n)[:, None] * np.exp(6j * rng.random((n, LINES)))
    motion = strength[:, :, None] * H
    force = strength + np.sqrt(force_noise) * normal(n, LINES)
    motion = motion + np.sqrt(motion_noise) * normal(n, LINES, 2)
    power = (np.abs(strength) ** 2).mean()
    return average_spectra(force, motion), power


def test_noise_on_the_force_lowers_h1_by_its_share_and_leaves_h2():
    averages, power = drawn(200, 0.2, 0.0)
    expected = H / (1 + 0.2 / power)
    np.testing.assert_allclose(estimate_frf(averages, "H1").mean(axis=0), expected, rtol=2e-3)
    np.testing.assert_allclose(estimate_frf(averages, "H2").mean(axis=0), H, rtol=2e-3)


def test_noise_on_the_motion_raises_h2_by_its_share_and_leaves_h1():
    averages, power = drawn(200, 0.0, 0.2)
    expected = H * (1 + 0.2 / power / np.abs(H) ** 2)
    np.testing.assert_allclose(estimate_frf(averages, "H2").mean(axis=0), expected, rtol=6e-3)
    np.testing.assert_allclose(estimate_frf(averages, "H1").mean(axis=0), H, rtol=5e-3)


def test_hv_with_the_right_noises_has_no_bias():
    averages, _ = drawn(200, 0.2, 0.3)
    noise = np.full(LINES, 0.2), np.full((LINES, 2), 0.3)
    np.testing.assert_allclose(estimate_frf(averages, "Hv", noise).mean(axis=0), H, rtol=6e-3)
    for other in ("H1", "H2"):
        assert (np.abs(estimate_frf(averages, other).mean(axis=0) / H - 1) > 0.1).any()


def test_hv_of_unknown_noises_is_the_geometric_mean_of_h1_and_h2():
    averages, _ = drawn(5, 0.1, 0.1)
    h1, h2 = estimate_frf(averages, "H1"), estimate_frf(averages, "H2")
    between = np.sqrt(np.abs(h1) * np.abs(h2)) * np.exp(1j * np.angle(h1))
    np.testing.assert_allclose(estimate_frf(averages, "Hv"), between, rtol=1e-12)


@pytest.mark.parametrize("ratio", [1e-12, 1e-3, 1.0, 1e3, 1e12])
def test_hv_lies_between_h1_and_h2_whatever_the_noises(ratio):
    averages, _ = drawn(5, 0.1, 0.1)
    noise = np.ones(LINES), np.full((LINES, 2), ratio)
    size = np.abs(estimate_frf(averages, "Hv", noise))
    assert (size >= np.abs(estimate_frf(averages, "H1")) * (1 - 1e-9)).all()
    assert (size <= np.abs(estimate_frf(averages, "H2")) * (1 + 1e-9)).all()


def test_hv_becomes_h1_without_noise_on_the_force_and_h2_without_noise_on_the_motion():
    averages, _ = drawn(5, 0.1, 0.1)
    for ratio, estimator in ((1e14, "H1"), (1e-14, "H2")):
        noise = np.ones(LINES), np.full((LINES, 2), ratio)
        found = estimate_frf(averages, "Hv", noise)
        np.testing.assert_allclose(found, estimate_frf(averages, estimator), rtol=1e-9)


def test_h1_over_h2_is_the_coherence():
    averages, _ = drawn(5, 0.1, 0.1)
    share = estimate_frf(averages, "H1") / estimate_frf(averages, "H2")
    np.testing.assert_allclose(share, averages.coherence, rtol=1e-12)


@pytest.mark.parametrize("n", [3, 5, 10, 30])
def test_the_variance_of_h1_has_no_bias_with_noise_on_the_motion(n):
    # Least squares with n - 1 complex values free: E of the predicted variance is the true one.
    averages, _ = drawn(n, 0.0, 0.05)
    values = estimate_frf(averages, "H1")
    predicted = coherence_variance(values, averages.coherence, n)
    ratio = (np.abs(values - H) ** 2).mean(axis=0) / predicted.mean(axis=0)
    # n = 3: 2 free values make the mean of 4000 predictions certain to 1 / sqrt(8000) and so on.
    np.testing.assert_allclose(ratio, 1.0, atol=5 / np.sqrt(LINES))


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
@pytest.mark.parametrize(("force_noise", "motion_noise"), [(0.0, 0.02), (0.01, 0.0), (0.01, 0.02)])
def test_to_first_order_all_estimators_have_the_variance_of_h1(
    estimator, force_noise, motion_noise
):
    n = 20
    averages, _ = drawn(n, force_noise, motion_noise)
    noise = None
    if estimator == "Hv" and force_noise and motion_noise:
        noise = np.full(LINES, force_noise), np.full((LINES, 2), motion_noise)
    values = estimate_frf(averages, estimator, noise)
    predicted = coherence_variance(values, averages.coherence, n).mean(axis=0)
    scatter = (np.abs(values - values.mean(axis=0)) ** 2).mean(axis=0)
    np.testing.assert_allclose(scatter / predicted, 1.0, atol=0.12)


def test_of_the_errors_95_per_cent_lie_within_the_predicted_circle():
    # |error|^2 over its variance is F(2, 2 (n - 1)) distributed; its 95 % point from that.
    from_above = 95.0
    n = 8
    averages, _ = drawn(n, 0.0, 0.05)
    values = estimate_frf(averages, "H1")
    ratio = np.abs(values - H) ** 2 / coherence_variance(values, averages.coherence, n)
    point = (n - 1) * ((1 - from_above / 100) ** (-1 / (n - 1)) - 1)  # of F(2, 2 (n - 1))
    covered = 100 * (ratio < point).mean()
    assert covered == pytest.approx(from_above, abs=0.8)


def test_a_channel_at_rest_has_no_coherence_and_no_frf():
    force = np.ones((3, 4), complex)
    averages = average_spectra(force, np.zeros((3, 4, 1), complex))
    assert not averages.coherence.any()
    for estimator in ("H1", "H2", "Hv"):
        assert not estimate_frf(averages, estimator).any()
