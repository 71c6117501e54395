"""The hammer test: pulses, coherence, and a variance formula that holds."""

from dataclasses import replace

import numpy as np
import pytest

from truth.campaign import Plan, measure
from truth.draw import Tolerance, draw_basis, draw_hammers, stream
from truth.dynamics import accelerance, assemble
from truth.effects import Nothing
from truth.errors import TruthError
from truth.measure import (
    PULSE_SECONDS,
    estimate_h1,
    hammer_test,
    lines_hz,
    noise_spectrum,
    pulse_spectra,
)

EXACT = Tolerance(*[0.0] * 9)


@pytest.fixture(scope="module")
def measured(nominal):
    station = draw_basis(nominal, 2)
    return measure(station, Nothing(), draw_hammers(station, 11, EXACT, 2), Plan(2))


def test_pulses_are_half_sines(nominal):
    # One pulse without scatter, integrated numerically.
    class Middle:
        def uniform(self, low, high, shape):
            return np.full(shape, (low + high) / 2)

    freq = np.array([0.0, 50.0, 1 / (2 * PULSE_SECONDS), 200.0])
    time = np.linspace(0, PULSE_SECONDS, 20001)
    pulse = 200 * np.sin(np.pi * time / PULSE_SECONDS)
    turning = np.exp(-2j * np.pi * freq[:, None] * time)
    expected = np.trapezoid(pulse * turning, time, axis=1)
    np.testing.assert_allclose(pulse_spectra(freq, 1, 200.0, Middle())[0], expected, rtol=1e-6)


def test_the_force_has_fallen_by_ten_to_twenty_decibels_at_200_hz():
    spectra = np.abs(pulse_spectra(np.array([0.0, 200.0]), 500, 200.0, stream(1, "hits")))
    fall = 20 * np.log10(spectra[:, 0] / spectra[:, 1])
    assert 10 < np.median(fall) < 20
    assert fall.min() > 8.5
    assert fall.max() < 22


def test_h1_and_coherence_of_a_hand_made_case():
    # Two hits, forces 1 and i, readings 2 and 0: sum XF* = 2, so H1 = 1, g2 = 4 / (4 * 2).
    force = np.array([[1.0], [1j]])
    reading = np.array([[[2.0 + 0j]], [[0j]]])
    frf, coherence = estimate_h1(force, reading)
    np.testing.assert_allclose(frf, [[1.0]])
    np.testing.assert_allclose(coherence, [[0.5]])


def test_the_variance_from_the_coherence_is_the_scatter_of_h1():
    # 150 tests of 40 lines: 6000 complex errors, each squared scatters by about 120 %, so the
    # ratio of the sums is known to 1.6 %; the test allows three times that.
    freq = 20.0 + np.arange(40.0)
    true = 1e-5 * (1 + 0.2j) * np.ones((40, 1, 1))
    n = 6
    errors, variances = 0.0, 0.0
    for seed in range(150):
        frf, g2 = hammer_test(true, freq, averages=n, level=200.0, seed=seed)
        errors += np.sum(np.abs(frf - true) ** 2)
        variances += np.sum(np.abs(frf) ** 2 * (1 - g2) / (g2 * (n - 1)))
    assert errors / variances == pytest.approx(1, abs=0.05)


def test_h1_has_no_bias_to_speak_of():
    freq = 20.0 + np.arange(40.0)
    true = 1e-4 * np.ones((40, 1, 1), dtype=complex)
    errors = [
        hammer_test(true, freq, averages=10, level=200.0, seed=seed)[0] - true for seed in range(60)
    ]
    spread = np.sqrt(np.mean(np.abs(errors) ** 2))
    assert abs(np.mean(errors)) < 4 * spread / np.sqrt(np.size(errors))


def test_coherence_is_good_above_20_hz_and_poor_below_8(measured):
    freq, g2 = measured.freq_hz, measured.coherence
    for low, high in [(20, 50), (50, 100), (100, 150), (150, 200)]:
        band = (freq >= low) & (freq <= high)
        assert 0.95 < np.median(g2[band]) < 0.9995
    assert np.median(g2[(freq >= 2) & (freq <= 8)]) < 0.3
    assert g2.min() >= 0
    assert g2.max() <= 1


def test_the_noise_figure_is_that_of_a_good_laboratory(measured):
    band = (measured.freq_hz >= 10) & (measured.freq_hz <= 200)
    power = np.abs(measured.frf[band]) ** 2
    variance = power * (1 - measured.coherence[band]) / (measured.coherence[band] * 9)
    noise = np.sqrt(variance.sum(axis=0) / power.sum(axis=0))
    assert 0.02 < np.sqrt(np.mean(noise[noise <= 0.3] ** 2)) < 0.06


def test_noise_falls_from_the_building_to_the_sensor():
    noise = noise_spectrum(lines_hz())
    assert np.isfinite(noise).all()
    assert (np.diff(noise[1:]) < 0).all()
    assert noise[0] / noise[-1] == pytest.approx(30, rel=1e-2)
    assert noise[-1] == pytest.approx(2e-5 * np.sqrt(4 / 2), rel=1e-3)


def test_the_line_at_zero_hertz_is_zero(measured):
    assert measured.freq_hz[0] == 0
    assert not measured.frf[0].any()
    assert np.abs(measured.frf[1:]).min() > 0


def test_a_hit_that_drowns_the_noise_gives_every_channel_its_exact_value(nominal):
    station = draw_basis(nominal, 4)
    hammers = draw_hammers(station, 11, EXACT, 4)
    loud = measure(station, Nothing(), hammers, Plan(4, level=1e10))
    exact = accelerance(station, assemble(station), hammers, loud.freq_hz)
    labels = [(sensor.node, axis) for _, sensor in station.sensors() for axis in (1, 2, 3)]
    assert loud.responses == tuple((node, axis) for node in range(1, 24) for axis in (1, 2, 3))
    assert loud.references == ((11, 1), (11, 2), (11, 3))
    # What is left from 5 Hz on is the force's noise, 1e-3 / sqrt(10) of each value.
    for row, label in enumerate(loud.responses):
        expected = exact[20:, labels.index(label)]
        np.testing.assert_allclose(loud.frf[20:, row], expected, rtol=2e-3)


def test_a_harder_hit_gives_a_better_coherence(nominal):
    true = 1e-4 * np.ones((801, 1, 1), dtype=complex)
    soft, hard = (
        np.median(hammer_test(true, lines_hz(), averages=10, level=level, seed=1)[1])
        for level in (40.0, 1000.0)
    )
    assert soft < hard


@pytest.mark.parametrize(
    ("wrong", "words"),
    [({"averages": 1}, "at least 2"), ({"level": 0.0}, "peak force"), ({"level": np.nan}, "force")],
)
def test_a_test_that_cannot_be_made_is_refused(wrong, words):
    plan = {"averages": 10, "level": 200.0, "seed": 1} | wrong
    with pytest.raises(TruthError, match=words):
        hammer_test(np.ones((801, 1, 1), dtype=complex), lines_hz(), **plan)


def test_a_station_without_sensors_is_refused(one_body, hammers_at):
    bare = replace(one_body, stages=(replace(one_body.stages[0], sensors=()),))
    with pytest.raises(TruthError, match="nothing would be measured"):
        measure(bare, Nothing(), hammers_at(0, np.zeros(3)), Plan(1))
