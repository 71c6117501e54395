"""Pulses of the hammer: their spectrum, and their peak and duration from a campaign."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.hypothesis import Scene
from diagnosis.levels.hammer_pulse import (
    compute_pulse_force,
    compute_pulse_spectrum,
    estimate_pulses,
)
from diagnosis.levels.law_alone import LawAlone
from identification.hits.hit_frfs import estimate_hit_frfs
from identification.hits.settings import HitSettings
from identification.words import Campaign, Dof, Records, UnknownGains
from mbmodel import Model
from tests.helpers.nonlinear_joint import JOINT
from tests.helpers.nonlinear_mass import (
    FREQ_HZ,
    PULSE_S,
    STIFFNESS,
    level_campaign,
    nonlinear_block,
    session_of,
)

RATE_HZ, HITS, SAMPLES = 2048.0, 6, 4096
SIZES = np.linspace(0.9, 1.1, HITS)


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


def record_hits(test, peak, duration, sizes=SIZES):
    """Replace the FRFs of a test by those of hits, recorded as means over each sample."""
    fine = np.arange(16 * SAMPLES) / (16 * RATE_HZ) - 0.1013
    force = peak * compute_pulse_force(fine, duration).reshape(SAMPLES, 16).mean(axis=1)
    forces = np.outer(sizes, force)
    motion = np.repeat(np.gradient(forces, axis=1)[:, None], len(test.estimate.frf.outputs), axis=1)
    condition, outputs = test.condition, test.estimate.frf.outputs
    records = Records(
        RATE_HZ, forces, motion, outputs, condition.reference, "accelerance", test=condition.test
    )
    (hits,) = estimate_hit_frfs([records], [HitSettings(reject=False)])
    return replace(test, hits=hits)


def turn_around(test):
    """Return a test whose hammer hits along the negative axis."""
    reference = Dof.parse(str(test.condition.reference).replace("+", "-"))
    frf = replace(test.estimate.frf, inputs=(reference,))
    return replace(
        test,
        condition=replace(test.condition, reference=reference),
        estimate=replace(test.estimate, frf=frf),
    )


@pytest.mark.parametrize("duration", [4e-3, 6e-3, 15e-3])
def test_records_tell_peak_and_duration(block, duration):
    tests = list(level_campaign(block, None, (40.0, 100.0)).tests)
    tests[1] = turn_around(tests[1])
    peaks = np.array([44.0, 38.0, 47.0, 105.0, 110.0, 120.0])
    recorded = [record_hits(t, peak, duration) for t, peak in zip(tests, peaks, strict=True)]
    recorded[3] = replace(tests[3], hits=None)
    pulses = estimate_pulses(Campaign("mass", block.machine.layout, tuple(recorded)))
    assert pulses.duration_s == pytest.approx(duration, rel=0.05)
    momenta = pulses.peak * pulses.duration_s / duration
    expected = np.sqrt(np.mean(SIZES**2)) * peaks * [1, -1, 1, 1, 1, 1]
    recorded_alone = [0, 1, 2, 4, 5]
    np.testing.assert_allclose(momenta[recorded_alone], expected[recorded_alone], rtol=2e-3)
    assert pulses.peak[3] == 100.0


def test_a_force_that_points_the_other_way_is_a_hit_the_other_way(block):
    tests = level_campaign(block, None, (40.0,)).tests
    turned = tuple(record_hits(test, -40.0, 6e-3) for test in tests)
    assert (estimate_pulses(Campaign("mass", block.machine.layout, turned)).peak < 0).all()


def test_sizes_have_the_variance_of_the_recorded_hits(block):
    tests = level_campaign(block, None, (40.0,)).tests
    sizes = [SIZES, SIZES**3, np.ones(HITS)]
    recorded = [record_hits(t, 40.0, 6e-3, s) for t, s in zip(tests, sizes, strict=True)]
    pulses = estimate_pulses(Campaign("mass", block.machine.layout, tuple(recorded)))
    for number, expected in enumerate(sizes):
        relative = expected / np.sqrt(np.mean(expected**2))
        np.testing.assert_allclose(pulses.list_sizes(number, HITS), np.sort(relative), rtol=1e-3)
        few = pulses.list_sizes(number, 4)
        assert few.std() == pytest.approx(relative.std(), rel=1e-3, abs=1e-12)


def test_hits_too_short_for_the_simulation_keep_their_momentum(block):
    tests = level_campaign(block, None, (40.0,)).tests
    recorded = tuple(record_hits(test, 400.0, 5e-4, np.ones(HITS)) for test in tests)
    pulses = estimate_pulses(Campaign("mass", block.machine.layout, recorded))
    assert pulses.duration_s == pytest.approx(0.2 / FREQ_HZ[-1])
    np.testing.assert_allclose(pulses.peak * pulses.duration_s, 400.0 * 5e-4, rtol=0.01)


def test_a_hammer_of_unknown_gain_tells_duration_and_sizes_alone(block):
    tests = level_campaign(block, None, (40.0,)).tests
    recorded = tuple(record_hits(test, 0.3, 6e-3) for test in tests)
    unknown = UnknownGains(hammers={recorded[0].condition.instrument})
    campaign = Campaign("mass", block.machine.layout, recorded, unknown_gains=unknown)
    pulses = estimate_pulses(campaign)
    assert (pulses.peak == 40.0).all()
    assert pulses.duration_s == pytest.approx(6e-3, rel=0.05)
    assert pulses.list_sizes(0, HITS).std() > 0.05


def test_hits_of_a_level_that_returns_are_those_of_each_visit(block):
    first = level_campaign(block, None, (40.0, 100.0)).tests
    again = [
        replace(test, condition=replace(test.condition, test=f"{test.condition.test} again"))
        for test in first
    ]
    recorded = [record_hits(test, test.condition.level_n, 6e-3) for test in first]
    recorded += [record_hits(test, 1.2 * test.condition.level_n, 6e-3, SIZES**2) for test in again]
    pulses = estimate_pulses(Campaign("mass", block.machine.layout, tuple(recorded)))
    before, after = np.split(pulses.peak, 2)
    factor = 1.2 * np.sqrt(np.mean(SIZES**4) / np.mean(SIZES**2))
    np.testing.assert_allclose(after, factor * before, rtol=1e-3)
    assert pulses.list_sizes(6, 4).std() > 1.5 * pulses.list_sizes(0, 4).std()


@pytest.mark.parametrize("factor", [0.97, 1.03, 2.6])
def test_starts_are_scaled_by_the_hits_of_the_middle_level(block, factor):
    tests = level_campaign(block, None, (40.0, 100.0, 200.0)).tests
    recorded = tuple(record_hits(t, factor * t.condition.level_n, 6e-3) for t in tests)
    session = session_of(block, Campaign("mass", block.machine.layout, recorded))
    alone = LawAlone.of_scene(Scene(session, session.model.drawn), JOINT, STIFFNESS)
    assert alone.middle_stretch == pytest.approx(alone.largest_stretch / 2, rel=1e-3)
