"""A drive point that takes power: a delay turns all channels, a hammer beside it does not."""

import re
from pathlib import Path

import numpy as np
import pytest
from hammer_records import System

from identification.hits.negative_power import DrivePointMobility, explain_negative_power

FREQ_HZ = np.arange(20.0, 160.0, 0.25)
# Columns are modes at 31, 55, 88 and 140 Hz; the first row is the drive point.
SHAPES = np.array([[1.0, 0.8, -0.7, 0.5], [0.4, -0.9, 1.0, 0.6], [-0.8, 0.5, 0.9, -1.0]])


def drive_point(*, drive, delay_s=0.0):
    """Mobilities of a test whose force acts through these participations of the modes."""
    system = System(np.array([31.0, 55.0, 88.0, 140.0]), np.full(4, 0.02), SHAPES, np.array(drive))
    laplace = 2j * np.pi * FREQ_HZ
    channels = system.accelerance(laplace) / laplace[:, None]
    channels = channels * np.exp(-2j * np.pi * FREQ_HZ * delay_s)[:, None]
    deviation = np.full(len(FREQ_HZ), 1e-9)
    return DrivePointMobility(FREQ_HZ, laplace, channels[:, 0], "accelerance", deviation, channels)


@pytest.mark.parametrize("delay_s", [1e-3, 3e-3, 8.5e-3])
def test_a_delay_of_all_channels_is_named(delay_s):
    sentence = explain_negative_power(drive_point(drive=SHAPES[0], delay_s=delay_s), "here")
    late, size = re.search(r"motion (\w+) the force by ([\d.]+) ms: a delay", sentence).groups()
    assert late == ("lags" if delay_s > 0 else "leads")
    assert float(size) == pytest.approx(1e3 * abs(delay_s), abs=0.6)  # steps of 0.6 ms


@pytest.mark.parametrize(
    "drive", [[1.0, 0.8, 0.35, 0.2], [1.0, -0.4, -0.7, 0.1], [-0.3, 0.8, -0.7, 0.5]]
)
def test_a_hammer_beside_its_point_is_no_delay(drive):
    sentence = explain_negative_power(drive_point(drive=drive), "here")
    assert sentence is None or "ms" not in sentence


def test_few_lines_on_narrow_resonances_are_no_delay():
    """The measured tower on all its lines: modes of one line's width, and none of 1.6 ms."""
    with np.load(Path(__file__).parents[2] / "assets" / "tower" / "accelerance.npz") as data:
        freq_hz, frf = data["freq_hz"], data["frf"].astype(complex)
    chosen = freq_hz > 3.5
    laplace = 2j * np.pi * freq_hz[chosen]
    for floor in range(3):
        channels = frf[chosen, :, floor] / laplace[:, None]
        deviation = np.full(chosen.sum(), 1e-9)
        point = DrivePointMobility(
            freq_hz[chosen], laplace, channels[:, floor], "accelerance", deviation, channels
        )
        sentence = explain_negative_power(point, "here")
        assert sentence is None or "ms" not in sentence
