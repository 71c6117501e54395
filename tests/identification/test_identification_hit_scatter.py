"""Level test for free: modes against the peaks of the hits of one test."""

import numpy as np
import pytest

from identification.hits.hit_frfs import estimate_hit_frfs
from identification.hits.peak_slope import estimate_peak_slope
from identification.hits.settings import HitSettings
from identification.level_check import check_hits
from identification.modal import identify
from identification.words import Campaign, Condition, Dof, Records, Test
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from tests.helpers.nonlinear_mass import DAMPING, MASS_KG, MJCF, STIFFNESS

RATE_HZ, SECONDS, PULSE_S = 512.0, 4.0, 6e-3
TIMES = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
PEAKS_N = 100 * np.exp([-0.2, 0.1, 0.25, -0.1, 0.0, 0.15, -0.25, 0.05])


def test_the_slope_of_frfs_by_the_peak_is_that_of_the_model():
    random = np.random.default_rng(1)

    def draw(*shape):
        return random.standard_normal(shape) + 1j * random.standard_normal(shape)

    mean, slope, noise = draw(40, 3), draw(40, 3), 0.01 * draw(8, 40, 3)
    force = PEAKS_N[:, None] * np.exp(-1j * random.uniform(0, 6, (8, 1))) * np.ones(40)
    levels = np.log(PEAKS_N) - np.log(PEAKS_N).mean()
    motion = (mean + levels[:, None, None] * slope) * force[:, :, None] + noise
    found = estimate_peak_slope(force, motion, PEAKS_N)
    assert found.spread == pytest.approx(levels.std())
    pulls = (found.values - slope) / np.sqrt(found.variance)
    assert 0.7 < np.sqrt((np.abs(pulls) ** 2).mean()) < 1.4


def test_equal_or_few_hits_show_no_slope():
    force, motion = np.ones((8, 4), complex), np.ones((8, 4, 2), complex)
    assert estimate_peak_slope(force, motion, np.full(8, 100.0)) is None
    assert estimate_peak_slope(force[:3], motion[:3], PEAKS_N[:3]) is None


def recorded_campaign(folder, stiffening, loss=0.0):
    """Three directions of hits; the vertical spring and damper follow the peak of each hit."""
    path = folder / "mass.xml"
    path.write_text(MJCF, encoding="utf-8")
    model = as_drawn(load_machine(path))
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 4) for axis in range(3))
    references = tuple(Dof.of("block", axis) for axis in range(3))
    freq = np.fft.rfftfreq(len(TIMES), 1 / RATE_HZ)[1:]
    linear = Evaluator(model, FrfRequest(freq, outputs, references)).at(model.drawn).values
    s = 2j * np.pi * freq
    plain = s**2 / (MASS_KG * s**2 + DAMPING * s + STIFFNESS)
    begin = 0.05
    inside = (begin <= TIMES) & (begin + PULSE_S >= TIMES)
    pulse = np.where(inside, np.sin(np.pi * (TIMES - begin) / PULSE_S), 0.0)
    random, records = np.random.default_rng(2), []
    for column, reference in enumerate(references):
        motion = []
        for peak in PEAKS_N:
            level = np.log(peak / 100)
            stiffness = STIFFNESS * (1 + stiffening * level)
            damping = DAMPING * (1 + loss * level)
            frf = linear[:, :, column].copy()
            if column == 2:
                moved = s**2 / (MASS_KG * s**2 + damping * s + stiffness)
                frf[:, 2::3] += (moved - plain)[:, None]
            spectrum = np.fft.rfft(peak * pulse)[1:, None] * frf
            whole = np.concatenate([np.zeros((1, 9)), spectrum])
            motion.append(np.fft.irfft(whole, len(TIMES), axis=0).T)
        noisy = np.array(motion) + 1e-3 * random.standard_normal((len(PEAKS_N), 9, len(TIMES)))
        force = PEAKS_N[:, None] * pulse
        records.append(Records(RATE_HZ, force, noisy, outputs, reference, "accelerance"))
    settings = HitSettings(block_s=2.0, exponential_tau=0.0, reject=False)
    estimates = estimate_hit_frfs(records, [settings] * 3)
    tests = tuple(
        Test(Condition("hits", hits.reference), hits.estimate, hits) for hits in estimates
    )
    whole = Campaign("mass", model.machine.layout, tests)
    return whole.select_lines((whole.freq_hz > 20) & (whole.freq_hz < 140))


@pytest.mark.parametrize(
    ("stiffening", "loss"),
    [(0.0, 0.0), (0.02, 0.0), (-0.02, 0.5)],
)
def test_hits_of_one_test_show_how_modes_change_with_the_level(tmp_path, stiffening, loss):
    campaign = recorded_campaign(tmp_path, stiffening, loss)
    model, identified, _ = identify(campaign)
    inside = np.arange(len(model.poles)) < int(identified.inside.sum())
    check = check_hits(campaign, model, inside)
    assert check.is_constant == (stiffening == 0.0)
    assert check.is_within_tests
    vertical = min(check.trends, key=lambda trend: abs(trend.freq_hz[0] - 67.9))
    change = np.diff(vertical.freq_hz)[0] / np.diff(np.log(vertical.level))[0]
    deviation = vertical.freq_sd[0] * np.sqrt(2) / np.diff(np.log(vertical.level))[0]
    expected = 67.9 * stiffening / 2
    assert change == pytest.approx(expected, abs=4 * deviation + 0.1 * abs(expected))
    if loss:
        slope = np.diff(vertical.damping)[0] / np.diff(np.log(vertical.level))[0]
        assert slope == pytest.approx(0.0264 * (loss - stiffening / 2), rel=0.1)
