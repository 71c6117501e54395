"""The hammer test: pulses, coherence, and a variance formula that holds."""

from dataclasses import replace

import numpy as np
import pytest

from truth.campaign.draw import NO_TOLERANCE, draw_basis, draw_hammers
from truth.campaign.machine_on_test import Known, TrueMachine
from truth.campaign.measure import (
    PULSE_SECONDS,
    HalfSinePulses,
    draw_pulses,
    estimate_h1,
    hammer_tests,
    noise_spectrum,
    pulse_spectra,
)
from truth.campaign.protocol import Protocol, takes
from truth.campaign.virtual_test import Plan, draw_campaign
from truth.errors import TruthError
from truth.machine.rig import Occasion, Prepared, accelerance, build
from truth.random_streams import stream

ROWS = [3, 4, 5, 6, 7, 8, 0, 1, 2]  # of the small machine: nodes 1, 2, 3 in the station's order


def measure(station, protocol, seed):
    machine = TrueMachine(station, draw_hammers(station, protocol.nodes[0], NO_TOLERANCE, seed))
    return hammer_tests(machine, protocol, takes(protocol, station, seed), seed)


@pytest.fixture(scope="module")
def measured(nominal):
    return measure(draw_basis(nominal, 2), Protocol(), 2)[0]


@pytest.fixture(scope="module")
def small(two_bodies):
    """A machine of few channels, and lines where it is measured well."""
    return two_bodies, Protocol((1,), averages=6, lines=61, resolution_hz=1.0)


def test_pulses_are_half_sines():
    freq = np.array([0.0, 50.0, 1 / (2 * PULSE_SECONDS), 200.0])
    time = np.linspace(0, PULSE_SECONDS, 20001)
    pulse = 200 * np.sin(np.pi * time / PULSE_SECONDS)
    turning = np.exp(-2j * np.pi * freq[:, None] * time)
    pulses = HalfSinePulses(np.array([200.0]), np.array([PULSE_SECONDS]))
    expected = np.trapezoid(pulse * turning, time, axis=1)
    np.testing.assert_allclose(pulse_spectra(freq, pulses)[0], expected, rtol=1e-6)


def test_the_force_has_fallen_by_ten_to_twenty_decibels_at_200_hz():
    pulses = draw_pulses(500, 200.0, stream(1, "hits"))
    spectra = np.abs(pulse_spectra(np.array([0.0, 200.0]), pulses))
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


def test_the_variance_from_the_coherence_is_the_scatter_of_h1(small):
    # 2000 tests of 27 cells at 40 lines: the mean is known to far below the 2 % allowed.
    station, protocol = small
    machine = TrueMachine(station, draw_hammers(station, 1, NO_TOLERANCE, 1))
    (take,) = takes(protocol, station, 1)
    true = accelerance(machine.rig(Occasion()), protocol.freq_hz)[21:]
    errors, variances = 0.0, 0.0
    for seed in range(2000):
        (test,) = hammer_tests(machine, protocol, (take,), seed)
        rows = ROWS
        frf, g2 = test.frf[21:], test.coherence[21:]
        errors += np.mean(np.abs(frf - true[:, rows]) ** 2 / np.abs(true[:, rows]) ** 2)
        variances += np.mean(
            np.abs(frf) ** 2
            * (1 - g2)
            / (g2 * (protocol.averages - 1))
            / np.abs(true[:, rows]) ** 2
        )
    assert errors / variances == pytest.approx(1, abs=0.02)


def test_h1_has_no_bias_to_speak_of(small):
    station, protocol = small
    known = Known(TrueMachine(station, draw_hammers(station, 1, NO_TOLERANCE, 1)), protocol.freq_hz)
    true = known.on(Occasion(node=1))[1][21:, ROWS]
    tests = [measure(station, protocol, seed)[0] for seed in range(60)]
    errors = np.array([test.frf[21:] - true for test in tests]) / np.abs(true)
    spread = np.sqrt((np.abs(errors) ** 2).mean(axis=0) / len(tests))
    assert np.median(np.abs(errors.mean(axis=0)) / spread) < 1.5
    assert (np.abs(errors.mean(axis=0)) / spread).max() < 6


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
    noise = noise_spectrum(Protocol().freq_hz, 0.25)
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
    (loud,) = measure(station, Protocol(levels=(1e10,)), 4)
    hammers = draw_hammers(station, 11, NO_TOLERANCE, 4)
    exact = accelerance(build(Prepared(station, hammers)), loud.freq_hz)
    labels = [(sensor.node, axis) for _, sensor in station.sensors() for axis in (1, 2, 3)]
    assert loud.responses == tuple((node, axis) for node in range(1, 24) for axis in (1, 2, 3))
    assert loud.references == ((11, 1), (11, 2), (11, 3))
    # What is left from 5 Hz on is the force's noise, 1e-3 / sqrt(10) of each value.
    for row, label in enumerate(loud.responses):
        expected = exact[20:, labels.index(label)]
        np.testing.assert_allclose(loud.frf[20:, row], expected, rtol=2e-3)


def test_a_harder_hit_gives_a_better_coherence(small):
    station, protocol = small
    soft, hard = measure(station, replace(protocol, levels=(40.0, 1000.0)), 1)
    assert np.median(soft.coherence) < np.median(hard.coherence)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"averages": 1}, "at least 2"),
        ({"levels": (0.0,)}, "peak force"),
        ({"levels": (200.0, np.nan)}, "force"),
    ],
)
def test_a_test_that_cannot_be_made_is_refused(wrong, words):
    with pytest.raises(TruthError, match=words):
        Protocol(**wrong)


def test_a_station_without_sensors_is_refused(one_body):
    bare = replace(one_body, stages=(replace(one_body.stages[0], sensors=()),))
    with pytest.raises(TruthError, match="nothing would be measured"):
        draw_campaign(bare, Plan(1))
