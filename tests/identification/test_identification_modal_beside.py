"""Modes beside the band stand in the fit, so that those inside it are not biased."""

import numpy as np
import pytest
from modal_case import modal_case

from identification.modal import WeightedFrfs, identify_modes
from identification.modal.refinement import refine


def found_in(seed):
    case = modal_case(seed, 8, total=12, n_out=18, lines=401, start=10)
    s = 2j * np.pi * case.freq_hz
    data = WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), 1 / case.sd**2)
    return case, data, identify_modes(data, case.freq_hz)


def test_intervals_hold_for_machines_with_modes_above_the_band() -> None:
    pulls, misfits = [], []
    for seed in range(60_000, 60_008):
        case, _, found = found_in(seed)
        near = np.abs(found.fit.freq_hz[:, None] / case.modes_hz - 1).argmin(axis=0)
        pulls.append((found.fit.freq_hz[near] - case.modes_hz) / found.freq_sd[near])
        pulls.append((found.fit.damping[near] - case.damping) / found.damping_sd[near])
        misfits.append(found.misfit)
    # 128 pulls, robust against a single one: without guards the rms is above 1.3.
    assert np.sqrt(np.mean(np.square(np.clip(pulls, -4, 4)))) < 1.2
    assert max(misfits) < 1.06


def test_real_residuals_alone_do_not_stand_for_modes_next_to_the_band() -> None:
    _, data, found = found_in(60_000)
    inside = found.inside
    bare, _ = refine(data, found.fit.poles[inside], found.fit.participation[:, inside])
    assert bare.cost > 1.5 * found.fit.cost


def test_poles_beside_the_band_are_not_counted_as_modes() -> None:
    case, _, found = found_in(60_001)
    assert found.inside.sum() == len(case.modes_hz)
    assert (~found.inside).any()
    outside = found.fit.freq_hz[~found.inside]
    assert ((outside < case.freq_hz[0]) | (outside > case.freq_hz[-1])).all()


MODES_HZ = np.array([29.0, 79.0])


def on_a_free_axis(seed, drag, mobility):
    """Modes of an axis without a stop, from its receptance with noise; drag over mass [1/s]."""
    freq = 0.8 + 0.4 * np.arange(500)
    s, rng = 2j * np.pi * freq, np.random.default_rng(seed)
    poles = 2 * np.pi * MODES_HZ * np.exp(1j * (np.pi / 2 + np.array([0.015, 0.019])))
    gain = 1 / (s[:, None] - poles) / (2j * poles.imag)
    gain += 1 / (s[:, None] - poles.conj()) / (-2j * poles.imag)
    values = mobility / (s * (s + drag)) + gain @ [1e-3, 0.04]
    sd = 0.003 * np.abs(values) * (1 + 100 * (freq < 1))
    noise = sd * (rng.normal(size=500) + 1j * rng.normal(size=500)) / np.sqrt(2)
    cells = (values + noise)[:, None, None], 1 / sd[:, None, None] ** 2
    return identify_modes(WeightedFrfs(s, 0, *cells, np.ones((1, 1))), freq)


def test_the_pole_of_a_free_axis_leaves_the_deviations_of_modes_inside_the_band() -> None:
    results = [on_a_free_axis(seed, 1.8, 0.007) for seed in (7, 14, 31, 37)]
    deviations = [each.freq_sd[each.inside] for each in results]
    errors = np.array([each.fit.freq_hz[each.inside] for each in results]) - MODES_HZ
    # Rounding in the direction of the free axis gave deviations up to 35,000 times the scatter.
    scatter = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(np.max(deviations, axis=0) < 3 * scatter)
    assert np.all(scatter < 3 * np.min(deviations, axis=0))


def test_the_drag_of_a_free_axis_counts_where_its_pole_is_far_below_the_band() -> None:
    for seed in (2, 3):
        fitted = on_a_free_axis(seed, 1.2, 0.04)
        assert fitted.misfit < 1.1  # above 20 without its pole
        assert fitted.fit.damping[fitted.inside] == pytest.approx(np.sin([0.015, 0.019]), rel=0.01)
