"""Pulses of the hammer: their spectrum, and their peak and duration from a campaign."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.levels.hammer_pulse import (
    compute_pulse_force,
    compute_pulse_spectrum,
    estimate_pulses,
)
from identification.hits.hit_frfs import estimate_hit_frfs
from identification.hits.settings import HitSettings
from identification.words import Records
from mbmodel import Model
from tests.helpers.nonlinear_mass import FREQ_HZ, PULSE_S, level_campaign, nonlinear_block

RATE_HZ, HITS, SAMPLES = 2048.0, 6, 4096


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Model:
    return nonlinear_block(tmp_path_factory.mktemp("mass"))


def test_the_spectrum_of_a_half_sine_is_its_fourier_integral():
    times = np.linspace(0, PULSE_S, 20_001)
    kernel = np.exp(-2j * np.pi * FREQ_HZ[:, None] * times)
    integral = np.trapezoid(kernel * compute_pulse_force(times, PULSE_S), times, axis=1)
    np.testing.assert_allclose(compute_pulse_spectrum(FREQ_HZ, PULSE_S), integral, atol=1e-10)


@pytest.mark.parametrize("duration", [4e-3, 6e-3, 9e-3])
@pytest.mark.parametrize("colour", [0.0, -1.0])
def test_the_duration_of_hits_follows_from_the_variance(block, duration, colour):
    campaign = level_campaign(block, None, (100.0,))
    random, tests = np.random.default_rng(3), []
    for test in campaign.tests:
        scatter = random.chisquare(20, test.estimate.variance.shape) / 20
        fade = np.abs(compute_pulse_spectrum(FREQ_HZ, duration)) ** 2
        noise = FREQ_HZ[:, None, None] ** colour / fade[:, None, None]
        estimate = replace(test.estimate, variance=noise * scatter)
        tests.append(replace(test, estimate=estimate))
    campaign = replace(campaign, tests=tuple(tests))
    assert estimate_pulses(campaign).duration_s == pytest.approx(duration, rel=0.06)


def test_hits_whose_spectrum_is_flat_have_the_usual_duration(block):
    campaign = level_campaign(block, None, (100.0,))
    flat = [
        replace(t, estimate=replace(t.estimate, variance=np.ones_like(t.estimate.variance)))
        for t in campaign.tests
    ]
    pulses = estimate_pulses(replace(campaign, tests=tuple(flat)))
    assert (np.abs(pulses.peak) == 100).all()
    assert pulses.duration_s == pytest.approx(1 / FREQ_HZ[-1])


def record_hits(test, peak, duration):
    """Replace the FRFs of a test by those of hits, recorded as means over each sample."""
    fine = np.arange(16 * SAMPLES) / (16 * RATE_HZ) - 0.1013
    force = peak * compute_pulse_force(fine, duration).reshape(SAMPLES, 16).mean(axis=1)
    forces = np.outer(np.linspace(0.9, 1.1, HITS), force)
    motion = np.repeat(np.gradient(forces, axis=1)[:, None], len(test.estimate.frf.outputs), axis=1)
    condition, outputs = test.condition, test.estimate.frf.outputs
    records = Records(
        RATE_HZ, forces, motion, outputs, condition.reference, "accelerance", test=condition.test
    )
    (hits,) = estimate_hit_frfs([records], [HitSettings(reject=False)])
    return replace(test, hits=hits)


@pytest.mark.parametrize("duration", [4e-3, 6e-3, 15e-3])
def test_records_tell_peak_and_duration(block, duration):
    campaign = level_campaign(block, None, (40.0, 100.0))
    stated = [test.condition.level_n for test in campaign.tests]
    tests = [
        record_hits(t, 1.1 * level, duration)
        for t, level in zip(campaign.tests, stated, strict=True)
    ]
    pulses = estimate_pulses(replace(campaign, tests=tuple(tests)))
    assert pulses.duration_s == pytest.approx(duration, rel=0.03)
    signs = np.array([test.condition.reference.sign for test in tests])
    # Their sizes from 0.9 to 1.1 have a root mean square of 1.0023.
    np.testing.assert_allclose(pulses.peak, 1.1 * signs * stated, rtol=0.03)
    # Six sizes stand for the six hits themselves, fewer ones for equal shares of them.
    ratio = np.linspace(0.9, 1.1, HITS)
    ratio /= np.sqrt(np.mean(ratio**2))
    np.testing.assert_allclose(pulses.list_sizes(0, HITS), ratio, rtol=1e-3)
    np.testing.assert_allclose(pulses.list_sizes(0, 2), [ratio[1], ratio[4]], rtol=1e-3)


def test_hits_of_a_level_that_returns_are_those_of_each_visit(block):
    campaign = level_campaign(block, None, (40.0, 100.0))
    first = [record_hits(test, test.condition.level_n, 6e-3) for test in campaign.tests]
    again = [
        record_hits(
            replace(test, condition=replace(test.condition, test=f"{test.condition.test} again")),
            1.2 * test.condition.level_n,
            6e-3,
        )
        for test in campaign.tests
    ]
    peaks = estimate_pulses(replace(campaign, tests=(*first, *again))).peak
    before, after = np.split(peaks, 2)
    np.testing.assert_allclose(after, 1.2 * before, rtol=1e-3)
