"""A campaign's tests side by side, and their modal model against the machine's own modes."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from identification.modal import (
    ModeChoices,
    WeightedFrfs,
    combine_tests,
    identify,
    identify_modes,
)
from identification.words import InputError
from mbmodel import model_modes


def modes_of(model, theta, campaign):
    found = model_modes(model, theta)
    low, high = campaign.freq_hz[[0, -1]]
    inside = (found.freq_hz > low) & (found.freq_hz < high) & found.oscillates
    return found.poles[inside]


def test_the_modes_of_a_virtual_test_are_the_machines_within_their_deviations(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    found, how, _ = identify(campaign)
    expected = modes_of(model, true_theta, campaign)
    own = found.poles[: how.inside.sum()]
    for pole in expected:
        near = int(np.argmin(np.abs(own - pole)))
        off = abs(found.freq_hz[near] - abs(pole) / 2 / np.pi)
        assert off < 5 * found.freq_sd[near] + 1e-4 * found.freq_hz[near]
    assert len(own) == len(expected)
    assert how.misfit == pytest.approx(1.0, abs=0.1)


def test_signs_of_channels_and_references_do_not_matter(model, true_theta, flip):
    campaign = virtual_campaign(model, true_theta)
    one, other = combine_tests(campaign), combine_tests(flip(campaign))
    np.testing.assert_allclose(other.values, one.values)
    assert one.outputs == other.outputs


def test_an_exponential_window_is_taken_off_the_damping(model, true_theta):
    plain = identify(virtual_campaign(model, true_theta))[0]
    windowed = identify(virtual_campaign(model, true_theta, taus=(0.3, 0.3, 0.3)))[0]
    strong = [int(np.argmin(np.abs(windowed.poles - pole))) for pole in plain.poles[:4]]
    np.testing.assert_allclose(windowed.damping[strong], plain.damping[:4], rtol=0.05)


def test_different_windows_are_refused(model, true_theta):
    campaign = virtual_campaign(model, true_theta, taus=(0.0, 0.3, 0.0))
    with pytest.raises(InputError, match="different exponential windows"):
        combine_tests(campaign)


def test_uneven_lines_are_refused(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    keep = np.arange(len(campaign.freq_hz)) % 4 < 3
    with pytest.raises(InputError, match="unevenly spaced"):
        combine_tests(campaign.select_lines(keep))


def test_channels_that_were_not_measured_weigh_nothing(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    test = campaign.tests[0]
    measured = test.estimate.measured.copy()
    measured[3] = False
    values = test.estimate.frf.values.copy()
    values[:, 3] = 0
    holed = replace(test.estimate, measured=measured, frf=replace(test.estimate.frf, values=values))
    data = combine_tests(
        replace(campaign, tests=(replace(test, estimate=holed), *campaign.tests[1:]))
    ).weight_by_variance()
    assert data.cells[3, 0] == 0
    assert (data.cells > 0).sum() == data.cells.size - 1


def test_lines_of_zeros_are_no_lines(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    tests = []
    for test in campaign.tests:
        values, variance = (np.array(a) for a in (test.estimate.frf.values, test.estimate.variance))
        values[:4], variance[:4], values[20], variance[20] = 0, 0, 0, 0
        frf = replace(test.estimate.frf, values=values)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf, variance=variance)))
    whole, _, _ = identify(campaign)
    found, how, measured = identify(replace(campaign, tests=tuple(tests)))
    assert len(measured.freq_hz) == len(campaign.freq_hz) - 5
    count = how.inside.sum()
    np.testing.assert_allclose(found.freq_hz[:count], whole.freq_hz[:count], rtol=1e-3)


def test_a_channel_of_zeros_is_not_measured(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    tests = []
    for test in campaign.tests:
        values, variance = (np.array(a) for a in (test.estimate.frf.values, test.estimate.variance))
        values[:, 2], variance[:, 2] = 0, 0
        frf = replace(test.estimate.frf, values=values)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf, variance=variance)))
    measured = combine_tests(replace(campaign, tests=tuple(tests)))
    assert not measured.measured[2].any()
    assert len(measured.freq_hz) == len(campaign.freq_hz)


def test_a_cell_that_is_noisy_in_a_part_of_the_band_weighs_by_that_part(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    plain = combine_tests(campaign).weight_by_variance().cells
    first = campaign.tests[0]
    variance = np.array(first.estimate.variance)
    variance[-len(variance) // 4 :, 1] *= 81
    noisy = replace(first, estimate=replace(first.estimate, variance=variance))
    cells = (
        combine_tests(replace(campaign, tests=(noisy, *campaign.tests[1:])))
        .weight_by_variance()
        .cells
    )
    np.testing.assert_allclose(cells[1, 0] / plain[1, 0], 1 / 81, rtol=0.2)
    others = np.ones(cells.shape, bool)
    others[1, 0] = False
    np.testing.assert_allclose(cells[others], plain[others], rtol=1e-9)


@pytest.mark.parametrize("grows", [0, 1, 2, 3])
@pytest.mark.parametrize("n_in", [1, 2])
def test_a_growing_mode_among_decaying_ones_has_its_negative_damping(grows, n_in):
    # A plant in its loop: FRFs by modal superposition with one pole in the right half plane.
    rng = np.random.default_rng(10 * grows + n_in)
    freq, damping = np.array([20.0, 35.0, 52.0, 80.0]), np.array([0.01, 0.015, 0.008, 0.02])
    damping[grows] *= -1
    poles = 2 * np.pi * freq * (-damping + 1j * np.sqrt(1 - damping**2))
    shapes = rng.uniform(0.4, 1.2, (6, 4)) * rng.choice([-1.0, 1.0], (6, 4))
    lines = 0.5 * np.arange(1, 201)
    s = 2j * np.pi * lines[:, None, None, None]
    residues = shapes[:, None] * shapes[:n_in] / (2j * poles.imag)
    terms = residues / (s - poles) + residues.conj() / (s - poles.conj())
    clean = s[..., 0] ** 2 * terms.sum(axis=-1)
    sd = 0.01 * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
    noise = rng.normal(size=(2, *clean.shape)) / np.sqrt(2)
    values = clean + sd * (noise[0] + 1j * noise[1])
    data = WeightedFrfs(s[:, 0, 0, 0], 2, values, np.ones((200, 1, 1)), 1 / sd**2)
    identified = identify_modes(data, lines)
    inside = identified.inside
    np.testing.assert_allclose(identified.fit.freq_hz[inside], freq, rtol=1e-3)
    np.testing.assert_allclose(identified.fit.damping[inside], damping, rtol=0.1)
    assert identified.misfit == pytest.approx(1.0, abs=0.15)


def test_a_mode_can_be_forced_to_grow(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    modal, how, _ = identify(campaign, choices=ModeChoices(force=((40.0, -0.02),)))
    poles = modal.poles[: how.inside.sum()]
    assert np.abs(poles - 2 * np.pi * 40 * (0.02 + 1j * np.sqrt(1 - 0.02**2))).min() < 1e-9
