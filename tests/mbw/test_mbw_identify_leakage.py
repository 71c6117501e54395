"""Modes that ring longer than the segments of a Hann-windowed test are named."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from mbw.command import app

RUNNER = CliRunner()
LAYOUT = "".join(f"[site.acc{k}]\nposition = [0.{k}, 0.0, 0.0]\n" for k in range(1, 4))
CAMPAIGN = """\
layout = "layout.toml"
[[test]]
file = "t.npz"
channels = "nodes 1..3, z"
references = ["1:+z"]
"""
SEGMENT_S, RATE_HZ, SEGMENTS = 4.0, 256.0, 40


def hann_frfs(damping):
    """H1 of modes at 20 and 45 Hz under noise excitation, Hann segments that overlap by half."""
    rng = np.random.default_rng(2)
    length = int(SEGMENT_S * RATE_HZ)
    total = length * (SEGMENTS + 8)
    force = rng.normal(size=total)
    s = 2j * np.pi * np.fft.rfftfreq(total, 1 / RATE_HZ)
    shapes = np.array([[1.0, 0.8], [0.7, -0.9], [0.4, 0.6]])
    motion = np.zeros((3, total))
    for mode, (frequency, zeta) in enumerate(zip((20.0, 45.0), damping, strict=True)):
        omega = 2 * np.pi * frequency
        gain = s**2 / (s**2 + 2 * zeta * omega * s + omega**2)
        motion += (
            shapes[:, mode, None] * shapes[0, mode] * np.fft.irfft(gain * np.fft.rfft(force), total)
        )
    motion += 0.02 * rng.normal(size=motion.shape)
    window = np.hanning(length)
    starts = np.arange(8 * length, total - length, length // 2)
    spectra = [np.fft.rfft(window * np.vstack([force, motion])[:, a : a + length]) for a in starts]
    cross = sum(x[1:] * x[0].conj() for x in spectra)
    power = sum(np.abs(x[0]) ** 2 for x in spectra)
    freq = np.arange(length // 2 + 1) / SEGMENT_S
    keep = (freq >= 5) & (freq <= 80)
    return freq[keep], (cross / power)[:, None, keep]


@pytest.mark.parametrize(("damping", "named"), [((0.001, 0.02), "mode 1"), ((0.02, 0.02), None)])
def test_the_remark_names_the_modes_that_leak(tmp_path, damping, named):
    freq, frf = hann_frfs(damping)
    np.savez(tmp_path / "t.npz", frf=frf, freq_hz=freq)
    (tmp_path / "layout.toml").write_text(LAYOUT, "utf-8")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, "utf-8")
    out = tmp_path / "out"
    result = RUNNER.invoke(app, ["identify", str(tmp_path), "--out", str(out), "--no-pictures"])
    assert result.exit_code == 0, result.stderr
    words = " ".join(result.stderr.split())
    modes = json.loads((out / "modes.json").read_text("utf-8"))["modes"]
    assert len(modes) >= 2
    if named is None:
        assert "its lines leak" not in words
    else:
        assert f"The half-power bandwidth of {named} is below" in words
        assert "ignore_hz" in words
        assert modes[0]["damping"] > 5 * damping[0]
