"""Order and signals of hits: what dies, hums, drifts or is coarse is named before the level is."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hammer_records import Hammer, a_system, strike

from identification.hits import HitSettings, estimate_hit_frf

SYSTEM = a_system()
TEN = tuple((0.1 + 0.0003 * k,) for k in range(10))


def hammer(**changes):
    return Hammer(times_s=TEN, **{"noise": 2e-3, **changes})


@pytest.fixture(scope="module")
def records():
    return strike(SYSTEM, hammer())


def remarks(records, **settings):
    return " ".join(estimate_hit_frf(records, HitSettings(**settings)).remarks)


def with_motion(records, change):
    """Records whose motion (n_record, n_out, n_sample) a function changed."""
    motion = records.motion.copy()
    change(motion)
    return replace(records, motion=motion)


def test_good_hits_have_no_fault(records):
    assert remarks(records) == ""


def test_a_channel_that_dies_after_the_third_hit_is_left_out(records):
    def change(motion):
        motion[3:, 2] = 2e-3 * np.random.default_rng(1).normal(size=motion[3:, 2].shape)

    hits = estimate_hit_frf(with_motion(records, change))
    assert len(hits.kept) == 10
    assert [str(dof) for dof in hits.estimate.frf.outputs] == ["11:+tz", "1:+tx", "2:+tz"]
    assert "1:-ty is dead in most of the hits" in hits.remarks[0]


def test_hits_without_a_channel_are_left_out_if_most_have_it(records):
    def change(motion):
        motion[7:, 2] = 2e-3 * np.random.default_rng(1).normal(size=motion[7:, 2].shape)

    hits = estimate_hit_frf(with_motion(records, change))
    assert [rejection.hit for rejection in hits.rejected] == [8, 9, 10]
    assert len(hits.estimate.frf.outputs) == 4


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_in_the_force_is_named(records, mains):
    time = np.arange(records.force.shape[1]) / records.rate_hz
    phase = np.arange(10)[:, None]
    humming = replace(records, force=records.force + 1.5 * np.sin(2 * np.pi * mains * time + phase))
    assert f"hum of {mains:g} Hz, whose amplitude is 0.0" in remarks(humming)


def test_noise_and_slow_drift_of_the_force_are_no_hum():
    noisy = strike(SYSTEM, hammer(force_noise=0.3))
    time = np.linspace(0, 1, noisy.force.shape[1])
    assert "hum" not in remarks(replace(noisy, force=noisy.force + 2 * np.sin(3 * time)))


def test_a_converter_of_8_bits_is_named(records):
    def change(motion):
        step = np.abs(motion[:, 1]).max() / 127
        motion[:, 1] = step * np.round(motion[:, 1] / step)

    assert "1:+tx resolves the whole range" in remarks(with_motion(records, change))
    assert estimate_hit_frf(with_motion(records, change)).peak_slope is None


def test_a_converter_of_16_bits_is_not_coarse(records):
    def change(motion):
        step = np.abs(motion).max() / 2**15
        motion[:] = step * np.round(motion / step)

    assert remarks(with_motion(records, change)) == ""


@pytest.mark.parametrize(
    ("channels", "named"), [(slice(None), "the gain"), (1, "the gain of 1:+tx")]
)
def test_a_gain_that_drifts_by_half_a_per_cent_a_hit_is_a_drift(records, channels, named):
    def change(motion):
        grown = 1 + 5e-3 * np.arange(10)
        motion[:, channels] *= grown.reshape((10,) + (1,) * (motion[:, channels].ndim - 1))

    hits = estimate_hit_frf(with_motion(records, change))
    # The gain of a hit scatters by 0.3 %, its slope over ten hits by 0.03 %.
    assert re.search(rf"{re.escape(named)} rises by 0\.[456]\d* % from hit", " ".join(hits.remarks))
    assert hits.peak_slope is None


def test_a_stiffness_that_drifts_is_a_drift_of_frequencies():
    hot = [
        strike(
            replace(SYSTEM, freq_hz=SYSTEM.freq_hz * (1 - 1e-3 * k)),
            Hammer(times_s=(TEN[k],), noise=2e-3, seed=20 + k),
        )
        for k in range(10)
    ]
    joined = replace(
        hot[0],
        force=np.concatenate([part.force for part in hot]),
        motion=np.concatenate([part.motion for part in hot]),
    )
    # Differences over two lines of narrow modes understate the slope, and so overstate the shift.
    fall = re.search(r"the natural frequency falls by ([\d.]+) % from hit to hit", remarks(joined))
    assert float(fall.group(1)) == pytest.approx(0.1, rel=0.25)


def test_a_gain_that_follows_the_peak_is_no_drift(records):
    peaks = np.abs(records.force).max(axis=1)

    def change(motion):
        motion *= (1 + 0.02 * np.log(peaks / peaks.mean()))[:, None, None]

    hits = estimate_hit_frf(with_motion(records, change))
    assert "drift" not in " ".join(hits.remarks)
    assert hits.peak_slope is not None
