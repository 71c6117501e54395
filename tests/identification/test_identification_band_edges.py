"""Band of real measurements: bad lines decide about no end, and smooth FRFs outrank a coherence."""

from dataclasses import replace

import numpy as np
import pytest
from identification_examples import a_layout, an_estimate

from identification import band_lines, select_band
from identification.modal import identify
from identification.noise.variance import coherence_variance, difference_variance
from identification.words import Campaign, Condition, Dof, Test

FREQ = np.arange(1601) * 0.3125
OUTPUT = Dof.parse("acc1:+tz")


def a_beam(rng, scatter):
    """Accelerance of a cantilever's first two modes, 34 and 212 Hz, as one lightly noisy FRF."""
    s = 2j * np.pi * FREQ
    values = np.zeros(len(FREQ), complex)
    for frequency, damping, size in ((34.0, 0.004, 0.02), (212.0, 0.002, 1.0)):
        omega = 2 * np.pi * frequency
        values += size * s**2 / (s**2 + 2 * damping * omega * s + omega**2)
    error = rng.normal(size=(2, len(FREQ))) / np.sqrt(2)
    return values + scatter * np.abs(values) * (error[0] + 1j * error[1])


def a_campaign(values, *coherences, averages=10):
    """One test for each coherence (n_freq,), all with the same FRF; None for a test without."""
    tests = []
    for k, coherence in enumerate(coherences):
        reference = Dof.of("hit11", k)
        estimate = an_estimate(values[:, None, None], [OUTPUT], [reference], freq_hz=FREQ)
        variance = difference_variance(values)
        if coherence is not None:
            variance = coherence_variance(values, coherence, averages)
            estimate = replace(estimate, coherence=coherence[:, None, None])
        estimate = replace(estimate, variance=variance[:, None, None], averages=averages)
        tests.append(Test(Condition("a.uff", reference), estimate))
    return Campaign("beam", a_layout(), tuple(tests))


def ends(campaign):
    freq = campaign.freq_hz[band_lines(campaign)]
    return freq[0], freq[-1]


def step(low, high):
    """Coherence of 0.9 from ``low`` to ``high`` and 0.1 elsewhere."""
    return np.where((low <= FREQ) & (high >= FREQ), 0.9, 0.1)


def a_noisy(*coherences):
    rng = np.random.default_rng(7)
    values = rng.normal(size=len(FREQ)) + 1j * rng.normal(size=len(FREQ))
    return a_campaign(values, *coherences)


def test_single_coherent_lines_are_no_end_of_the_band():
    coherence = step(20.0, 300.0)
    coherence[[1, 3, 4, 40, 1200, 1201, 1500]] = 0.95
    assert ends(a_noisy(coherence)) == pytest.approx((20.0, 300.0), abs=0.32)


def test_bad_lines_inside_do_not_end_the_band():
    coherence = step(20.0, 300.0)
    coherence[200:230] = 0.05
    coherence[[66, 67, 955, 956]] = 0.1
    assert ends(a_noisy(coherence)) == pytest.approx((20.0, 300.0), abs=0.32)


def test_tests_without_coherence_leave_the_band_to_those_with_it():
    assert ends(a_noisy(step(20.0, 300.0), None)) == pytest.approx((20.0, 300.0), abs=0.32)
    assert ends(a_noisy(None, None)) == (FREQ[1], FREQ[-1])


@pytest.mark.parametrize("seed", range(3))
def test_smooth_frfs_outrank_a_low_coherence_and_both_modes_are_found(seed):
    rng = np.random.default_rng(seed)
    coherence = np.clip(np.where(FREQ < 84, 0.7, 0.32) + 0.02 * rng.normal(size=len(FREQ)), 0, 1)
    coherence[:6] = 1.0  # such lines must not have all the weight
    campaign = select_band(a_campaign(a_beam(rng, 0.03), coherence))
    assert campaign.freq_hz[-1] == 500.0
    (remark,) = campaign.remarks
    assert "the median coherence is 0.32" in remark
    model, identified, _ = identify(campaign)
    modes = model.freq_hz[: identified.inside.sum()]
    for expected in (34.0, 212.0):
        assert np.abs(modes / expected - 1).min() < 0.005


def test_noise_that_an_exponential_window_makes_smooth_extends_no_band():
    rng = np.random.default_rng(5)
    time = np.arange(2 * len(FREQ))
    noise = rng.normal(size=len(time)) * np.exp(-time / (len(time) / 8))
    values = np.fft.rfft(noise)[: len(FREQ)]
    campaign = select_band(a_campaign(values, step(20.0, 300.0)))
    assert campaign.freq_hz[-1] == pytest.approx(300.0, abs=0.32)
    (remark,) = campaign.remarks
    assert "smooth" not in remark


def test_a_band_that_leaves_many_lines_out_says_which_and_why():
    (remark,) = select_band(a_noisy(step(20.0, 300.0))).remarks
    first, last = FREQ[FREQ > 0][[0, -1]]
    assert remark.startswith("the band is ")
    low, high = (float(remark.split()[k]) for k in (3, 5))
    assert (low, high) == pytest.approx((20.0, 300.0), abs=0.4)
    assert f"Hz of {first:.4g} to {last:.4g} Hz, because the median coherence" in remark
    few = step(20.0, 300.0)
    few[0.01 * last < FREQ] = 0.95
    assert select_band(a_noisy(few)).remarks == ()


def test_a_stated_band_needs_no_remark():
    campaign = select_band(a_campaign(a_beam(np.random.default_rng(0), 0.03), step(5, 84)), (5, 84))
    assert campaign.remarks == ()
