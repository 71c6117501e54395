"""Signals in time and densities of hits, against raw records and ``scipy.signal.welch``."""

import numpy as np
import pytest
import scipy.signal
from hammer_records import Hammer, a_system, strike

from identification.hits import estimate_hit_frf
from identification.hits.densities import envelope


@pytest.fixture(scope="module")
def records():
    return strike(a_system(), Hammer(noise=2e-3, duration_s=4.0, times_s=((0.3, 2.2),) * 3))


@pytest.fixture(scope="module")
def hits(records):
    return estimate_hit_frf(records)


def test_no_peak_of_a_long_record_is_lost(records, hits):
    whole = hits.whole_record
    force, motion = records.force[whole.record - 1], records.motion[whole.record - 1]
    assert len(whole.time_s) < len(force)
    assert whole.force.max() == force.max()
    np.testing.assert_array_equal(whole.motion.max(axis=0), motion.max(axis=1))
    np.testing.assert_array_equal(whole.motion.min(axis=0), motion.min(axis=1))
    when = whole.time_s[whole.force.argmax()]
    assert when == pytest.approx(force.argmax() / records.rate_hz, abs=0.01)
    assert (np.diff(whole.time_s) > 0).all()


def test_a_short_signal_is_shown_sample_by_sample():
    signals = np.random.default_rng(1).normal(size=(3, 50))
    positions, values = envelope(signals, 60)
    np.testing.assert_array_equal(positions, np.arange(50))
    np.testing.assert_array_equal(values, signals)


def test_an_envelope_keeps_the_order_of_its_extremes():
    ramp = np.concatenate([np.linspace(0, 1, 500), np.linspace(1, 0, 500)])[None]
    _, values = envelope(ramp, 100)
    assert (np.diff(values[0, :50]) >= 0).all()
    assert (np.diff(values[0, 50:]) <= 0).all()


def test_the_first_block_begins_before_the_first_averaged_hit(records, hits):
    block, first = hits.first_block, hits.kept[0]
    assert block.record == first.record
    assert block.time_s[0] == pytest.approx(first.time_s - hits.pretrigger_s, abs=1e-9)
    assert np.abs(block.force).max() == pytest.approx(abs(first.peak_n), rel=0.02)


def test_densities_are_those_of_welch_over_the_averaged_blocks(records, hits):
    size = round(hits.block_s * records.rate_hz)
    powers = []
    for hit in hits.kept:
        start = round((hit.time_s - hits.pretrigger_s) * records.rate_hz)
        block = records.motion[hit.record - 1, :, start : start + size]
        freq, power = scipy.signal.welch(
            block, records.rate_hz, window="boxcar", nperseg=size, detrend=False
        )
        powers.append(power)
    density = np.sqrt(np.mean(powers, axis=0))
    np.testing.assert_allclose(freq, hits.densities.freq_hz)
    lines = (freq > 10) & (freq < 200)  # offsets, which the blocks lose, are far below
    np.testing.assert_allclose(hits.densities.motion.T[:, lines], density[:, lines], rtol=0.02)
