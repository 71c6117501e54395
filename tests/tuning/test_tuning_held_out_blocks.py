"""Held-out blocks: from resonance to resonance, whatever is fitted."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import virtual_campaign

from mbmodel import model_modes
from tuning.assessment.held_out import assign_folds, find_blocks


@pytest.fixture(scope="module")
def fine(model, true_theta):
    """A test in which each mode has several lines."""
    return virtual_campaign(model, true_theta, noise=0.01, lines=1600)


def test_no_fold_holds_all_lines_of_a_mode_that_stands_out(model, true_theta, fine):
    modes, freq = model_modes(model, true_theta), fine.freq_hz
    starts = find_blocks(fine)
    folds = assign_folds(starts, len(freq))
    half_width = modes.damping * modes.freq_hz
    inside = (modes.freq_hz > freq[0]) & (modes.freq_hz < freq[-1]) & (modes.poles.imag > 0)
    seen = 0
    for centre, half in zip(modes.freq_hz[inside], half_width[inside], strict=True):
        lines = np.abs(freq - centre) <= half
        starts_near = np.abs(freq[starts] - centre).min()
        if starts_near <= half:  # a peak of its own: others hide behind a neighbour
            seen += 1
            assert len(set(folds[lines])) > 1
    assert seen >= 2


def test_blocks_cover_the_band_and_neighbours_are_in_different_folds(fine):
    starts = find_blocks(fine)
    n_freq = len(fine.freq_hz)
    folds = assign_folds(starts, n_freq)
    assert starts[0] == 0
    assert (np.diff(starts) > 0).all()
    assert np.diff([*starts, n_freq]).max() <= n_freq // 15
    assert (folds[starts[1:]] != folds[starts[1:] - 1]).all()
    assert set(folds) == set(range(5))
    assert (folds[starts] == np.arange(len(starts)) % 5).all()


def test_blocks_do_not_depend_on_units_signs_or_exchanged_channels(fine):
    test = fine.tests[0]
    scale = np.linspace(-3.0, 1e3, test.estimate.frf.values.shape[1])[::-1, None]
    estimate = test.estimate
    scaled = replace(
        estimate,
        frf=replace(estimate.frf, values=estimate.frf.values * scale),
        variance=estimate.variance * scale**2,
    )
    other = replace(fine, tests=(replace(test, estimate=scaled), *fine.tests[1:]))
    assert find_blocks(other).tolist() == find_blocks(fine).tolist()


def test_a_short_band_without_peaks_is_one_block(fine):
    short = fine.select_lines(slice(0, 8))
    flat = replace(
        short,
        tests=tuple(
            replace(
                test,
                estimate=replace(
                    test.estimate,
                    frf=replace(test.estimate.frf, values=np.ones_like(test.estimate.frf.values)),
                ),
            )
            for test in short.tests
        ),
    )
    assert find_blocks(flat).tolist() == [0]
