"""Circles of modes in the Nyquist plane, against the closed form of a single mode."""

import numpy as np
import pytest

from identification.impacts import ImpactSpectra
from identification.matching import ImpactModes, fit_mode_circles
from identification.words import Dof

HZ, FREQ = 34.5, np.arange(20.0, 60.0, 0.02)
DOFS = tuple(Dof.parse(f"acc{k}:+tz") for k in (1, 2, 3, 4))
C = np.array([0.7832, -0.4002, 1.4137, 0.0])  # m/s; table 3 of the gondola's paper, and a node


def decay_spectrum(hz, zeta, amplitude, late=0.0):
    """C (H - 1) of eq. 11, written out again: what a decay after an impact leaves of C H."""
    s, omega = 2j * np.pi * FREQ[:, None], 2 * np.pi * hz
    response = s**2 / (s**2 + 2 * zeta * omega * s + omega**2)
    return (response - 1) * amplitude * np.exp(1j * omega * late)


def impact_of(values, noise=1e-9):
    return ImpactSpectra(("a",), DOFS, FREQ, values[:, :, None], np.full((len(DOFS), 1), noise))


def mode_of(*hz, zeta):
    one = np.ones(len(hz))
    shapes = np.tile(C / np.linalg.norm(C), (len(hz), 1))
    excitation = np.ones((len(hz), 1))
    return ImpactModes(
        np.array(hz), zeta * one, 0.1 * one, 0.1 * one, shapes, 0 * shapes, excitation, one
    )


@pytest.mark.parametrize("zeta", [0.005, 0.016, 0.044])
@pytest.mark.parametrize("late", [0.0, 3e-3], ids=["on time", "3 ms late"])
def test_the_circle_of_one_mode_has_its_frequency_damping_and_signed_amplitude(zeta, late):
    spectra = impact_of(decay_spectrum(HZ, zeta, C, late))
    # Poles that are somewhat off choose the lines only.
    found = fit_mode_circles(spectra, mode_of(HZ * (1 + 0.2 * zeta), zeta=1.2 * zeta), 0)
    assert found.impact == 0
    amplitudes = np.array([channel.amplitude for channel in found.channels[:3]])
    for channel, amplitude in zip(found.channels[:3], C, strict=False):
        assert channel.circle.natural_hz == pytest.approx(HZ, rel=3e-5)
        assert channel.circle.damping == pytest.approx(zeta, rel=2 * zeta**2 + 1e-4)
        # Eq. 13: the diameter is C / (2 zeta).
        assert 2 * channel.circle.radius == pytest.approx(abs(amplitude) / (2 * zeta), rel=2e-3)
        assert channel.circle.scatter < 1e-3
    ratios = amplitudes / amplitudes[0]
    assert ratios == pytest.approx(C[:3] / C[0], rel=1e-6)  # with their signs
    assert abs(amplitudes[0]) == pytest.approx(C[0], rel=5e-3)
    still = found.channels[3]
    assert (still.circle, still.amplitude) == (None, None)
    assert "does not go round a circle" in still.reason


def test_half_power_points_lie_a_quarter_turn_from_the_resonance():
    zeta = 0.02
    found = fit_mode_circles(impact_of(decay_spectrum(HZ, zeta, C)), mode_of(HZ, zeta=zeta), 0)
    circle, values = found.channels[0].circle, found.values[:, 0]
    resonance = circle.radius * np.exp(1j * circle.phase)
    for factor, turn in ((1 - zeta, 1j), (1 + zeta, -1j)):  # 9 and 3 o'clock in fig. 6
        line = int(np.argmin(np.abs(found.freq_hz - factor * HZ)))
        step = np.pi * 0.5 * (found.freq_hz[1] - found.freq_hz[0]) / (zeta * HZ)
        apart = abs(values[line] - (circle.centre + turn * resonance))
        assert apart < (step + 2 * zeta) * circle.radius
    # At resonance the value is imaginary: eq. 13.
    assert abs(resonance.real) < 0.03 * abs(resonance.imag)


def test_lines_of_a_plot_surround_the_fitted_ones_and_are_few():
    found = fit_mode_circles(impact_of(decay_spectrum(HZ, 0.02, C)), mode_of(HZ, zeta=0.02), 0)
    assert 60 < len(found.freq_hz) <= 121
    assert np.ptp(found.freq_hz) == pytest.approx(6 * 0.02 * HZ, rel=0.05)
    assert np.ptp(found.freq_hz[found.is_fitted]) == pytest.approx(3 * 0.02 * HZ, rel=0.05)
    assert found.values.shape == (len(found.freq_hz), len(DOFS))


def test_a_channel_that_another_mode_dominates_has_a_reason_and_no_circle():
    strong = np.array([0.0, 0.0, 0.0, 1.0])
    values = decay_spectrum(HZ, 0.02, C) + decay_spectrum(HZ * 1.05, 0.02, strong)
    found = fit_mode_circles(impact_of(values), mode_of(HZ, zeta=0.02), 0)
    assert [channel.circle is not None for channel in found.channels] == [True, True, True, False]
    assert found.channels[3].reason


def test_the_circle_of_a_close_mode_is_not_taken_for_this_one():
    strong = np.array([0.0, 0.0, 0.0, 1.0])
    values = decay_spectrum(HZ, 0.03, C) + decay_spectrum(HZ * 1.03, 0.03, strong)
    modes = mode_of(HZ, 1.03 * HZ, zeta=0.03)
    first, second = (fit_mode_circles(impact_of(values), modes, mode) for mode in (0, 1))
    assert [channel.circle is not None for channel in first.channels] == [True] * 3 + [False]
    assert [channel.circle is not None for channel in second.channels] == [False] * 3 + [True]
    assert "here the mode at 35.54 Hz dominates" in first.channels[3].reason


def test_a_channel_of_noise_alone_has_no_circle():
    random = np.random.default_rng(6)
    values = decay_spectrum(HZ, 0.02, C)
    values[:, 3] = random.standard_normal((2, len(FREQ))).T @ [1.0, 1.0j]
    noise = fit_mode_circles(impact_of(values), mode_of(HZ, zeta=0.02), 0).channels[3]
    assert noise.circle is None
    assert noise.amplitude is None
    assert noise.reason


def test_noise_scatters_the_lines_and_leaves_the_circle():
    random = np.random.default_rng(5)
    values = decay_spectrum(HZ, 0.02, C)
    size = 0.02 * np.abs(values[:, 0]).max() / np.sqrt(2)
    noise = random.standard_normal((2, *values.shape)) * size
    found = fit_mode_circles(
        impact_of(values + noise[0] + 1j * noise[1]), mode_of(HZ, zeta=0.02), 0
    )
    channel = found.channels[0]
    # 2 % of the diameter in both directions is 2.8 % of the radius along it.
    assert channel.circle.scatter == pytest.approx(0.04 / np.sqrt(2), rel=0.25)
    assert channel.circle.damping == pytest.approx(0.02, rel=0.02)
    assert channel.circle.natural_hz == pytest.approx(HZ, rel=5e-4)
