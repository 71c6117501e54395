"""Many channels are compressed to the combinations that stand above the noise: same modes."""

import numpy as np
import pytest
from modal_case import modal_case

from identification.modal import WeightedFrfs, channel_compression, identify_modes
from identification.modal.channel_compression import compress_channels
from identification.modal.shape_fit import fit_shapes, fit_shapes_with_sums

MANY = {"total": 7, "n_out": 60, "n_in": 2, "lines": 401}


@pytest.fixture
def compressed(monkeypatch):
    monkeypatch.setattr(channel_compression, "MAX_WHOLE_VALUES", 1000)


def data_of(case, *, wrong_weights=1.0):
    s = 2j * np.pi * case.freq_hz
    return WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), wrong_weights / case.sd**2)


def test_modes_of_compressed_channels_are_those_of_all_within_their_deviation(monkeypatch):
    case = modal_case(11, 5, **MANY)
    whole = identify_modes(data_of(case), case.freq_hz)
    monkeypatch.setattr(channel_compression, "MAX_WHOLE_VALUES", 1000)
    few = identify_modes(data_of(case), case.freq_hz)
    chosen, expected = np.flatnonzero(few.inside), np.flatnonzero(whole.inside)
    assert len(chosen) == len(expected) == 5
    shift = few.fit.freq_hz[chosen] - whole.fit.freq_hz[expected]
    assert (np.abs(shift) < whole.freq_sd[expected]).all()
    shift = few.fit.damping[chosen] - whole.fit.damping[expected]
    assert (np.abs(shift) < whole.damping_sd[expected]).all()
    # What is left out is noise: as little is known of the poles as from all channels.
    np.testing.assert_allclose(few.freq_sd[chosen], whole.freq_sd[expected], rtol=0.2)
    assert few.misfit == pytest.approx(whole.misfit, rel=0.01)
    assert len(few.fit.shapes) == 60
    error = np.abs(few.fit.values(data_of(case).laplace, 2) - case.clean)
    assert np.sqrt((error**2).mean()) < 0.3 * np.sqrt((case.sd**2).mean())


def test_there_are_no_more_combinations_than_patterns_of_the_modes(compressed):
    case = modal_case(12, 4, **MANY)
    few = compress_channels(data_of(case))
    assert few.values.shape[1] <= 2 * 7 + 2 * 2  # Re and Im of each shape, and residual terms
    assert (few.values * np.sqrt(few.cells)).var(axis=0).max(axis=1).min() > 1.0  # above its noise


@pytest.mark.parametrize("channels", [slice(0, 20), slice(0, 60, 3)])
def test_channels_that_are_weighted_wrongly_do_not_look_like_signal(compressed, channels):
    case = modal_case(12, 4, **MANY)
    wrong = np.ones_like(case.sd)
    wrong[channels] = 5.0
    right = compress_channels(data_of(case)).values.shape[1]
    assert compress_channels(data_of(case, wrong_weights=wrong)).values.shape[1] == right


def test_the_noise_of_combinations_is_that_of_their_channels(compressed):
    case = modal_case(13, 4, **MANY)
    few = compress_channels(data_of(case))
    s = data_of(case).laplace
    known = few.values.shape[1]
    fitted = fit_shapes(few, case.poles, case.shapes[case.drives])
    error = np.abs(few.values - fitted.values(s, 2)) ** 2 * few.cells
    parameters = (2 * 7 + 4) / (2 * 2 * len(s))
    assert error.mean() == pytest.approx(1 - parameters, rel=0.05)
    assert known < 60


@pytest.mark.parametrize("reason", ["few values", "a cell not measured", "noise alone"])
def test_frfs_that_cannot_be_compressed_stay_as_they_are(monkeypatch, reason):
    if reason != "few values":
        monkeypatch.setattr(channel_compression, "MAX_WHOLE_VALUES", 1000)
    case = modal_case(12, 4, **MANY)
    data = data_of(case)
    if reason == "a cell not measured":
        data.cells[3, 1] = 0.0
    if reason == "noise alone":
        data.values[:] = case.noisy - case.clean
    assert compress_channels(data) is data


def test_the_cost_of_blocks_of_lines_is_that_of_all(monkeypatch):
    case = modal_case(12, 4, **MANY)
    data, rows = data_of(case), case.shapes[case.drives]
    at_once, _ = fit_shapes_with_sums(data, case.poles, rows)
    monkeypatch.setattr("identification.modal.shape_fit._N_BLOCK_VALUES", 1000)
    assert fit_shapes(data, case.poles, rows).cost == pytest.approx(at_once.cost, rel=1e-12)
