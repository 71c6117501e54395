"""Records that the analyser has windowed already: FRFs, damping, and the remark without the key."""

from dataclasses import replace

import numpy as np
import pytest
from hammer_records import Hammer, a_system, channel_functions, strike
from identification_examples import read_written, write_campaign

from identification import band_lines
from identification.hits import HitSettings, estimate_hit_frf
from identification.modal import identify

SYSTEM = a_system(damping=(0.01, 0.015, 0.008, 0.02))
HAMMER = Hammer(noise=2e-3, force_noise=2e-3, outputs=("7:+z", "1:+x", "1:-y", "2:+z"))
HAMMER = replace(HAMMER, reference="7:+z", duration_s=1.0, times_s=((0.05,),) * 5)


def window(records, tau, *, forces=True):
    """Records as an analyser stores them that multiplies with exp(-t / tau)."""
    decay = np.exp(-np.arange(records.force.shape[1]) / records.rate_hz / tau)
    force = records.force * decay if forces else records.force
    return replace(records, force=force, motion=records.motion * decay)


@pytest.fixture(scope="module")
def records():
    return strike(SYSTEM, HAMMER)


@pytest.mark.parametrize("own_tau", [0.0, 0.3])
def test_both_windows_multiply(records, own_tau):
    settings = HitSettings(window_tau=0.15, exponential_tau=own_tau)
    found = estimate_hit_frf(window(records, 0.15), settings).estimate
    decay = 1 / 0.15 + (1 / own_tau if own_tau else 0.0)
    assert found.window_tau == pytest.approx(1 / decay)
    band = (found.frf.freq_hz > 10) & (found.frf.freq_hz < 200)
    exact = SYSTEM.accelerance(decay + 2j * np.pi * found.frf.freq_hz[band])
    error = found.frf.values[band, :, 0] - exact
    assert np.linalg.norm(error) < 0.02 * np.linalg.norm(exact)


def read(folder, records, keys):
    content = b"".join(part.content() for part in channel_functions(records, order="<"))
    head = f'model = "model.xml"\n[[test]]\nfile = "a.uff"\n{keys}\n'
    write_campaign(folder, head, {"a.uff": content})
    return read_written(folder, None)


def test_damping_comes_out_without_the_windows(tmp_path, records):
    campaign = read(tmp_path, window(records, 0.15), "window_tau = 0.15")
    model, identified, _ = identify(campaign.select_lines(band_lines(campaign, (10.0, 200.0))))
    assert identified.inside.sum() == 4
    np.testing.assert_allclose(model.freq_hz[:4], SYSTEM.freq_hz, rtol=1e-3)
    np.testing.assert_allclose(model.damping[:4], SYSTEM.damping, rtol=0.03)
    assert not any("window_tau" in remark for remark in campaign.remarks)


def test_a_window_that_no_key_states_is_remarked_with_its_time_constant(tmp_path, records):
    (remark,) = [r for r in read(tmp_path, window(records, 0.15), "").remarks if "window_tau" in r]
    assert "exp(-t / 0.15 s)" in remark


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_records_without_a_window_are_not_remarked(seed):
    for force_noise in (0.0, 2e-3):
        plain = strike(SYSTEM, replace(HAMMER, seed=seed, force_noise=force_noise))
        assert not any("window_tau" in r for r in estimate_hit_frf(plain).remarks)
