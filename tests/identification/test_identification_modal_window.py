"""Errors of FRFs that still carry an exponential window are alike from line to line."""

import numpy as np
import pytest

from identification.modal import MeasuredFrfs, identify_modes
from identification.words import Dof

LENGTH, COUNT, TAU = 4.0, 2048, 0.8  # of a block [s], its samples, the window [s]
FREQ, DAMPING = np.array([40.0, 71.0]), np.array([0.008, 0.012])
OUTPUTS = tuple(Dof(f"acc{k}", "+tz") for k in range(6))


def windowed_noise(rng, count):
    """White noise under the window, at the lines of the block; (n_line, count)."""
    time = np.arange(COUNT) * LENGTH / COUNT
    noise = rng.normal(size=(COUNT, count)) * np.exp(-time / TAU)[:, None]
    return np.fft.rfft(noise, axis=0)


def measured(seed, noise=0.004):
    rng = np.random.default_rng(seed)
    lines = np.arange(40, 401)
    freq = lines / LENGTH
    s = 1 / TAU + 2j * np.pi * freq
    poles = 2 * np.pi * FREQ * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    residues = rng.normal(size=(6, 2)) / (2j * poles.imag)
    values = (residues / (s[:, None, None] - poles)).sum(2)
    values += (residues.conj() / (s[:, None, None] - poles.conj())).sum(2)
    values *= (s**2)[:, None]
    error = windowed_noise(rng, 6)[lines]
    sd = noise * np.sqrt((np.abs(values) ** 2).mean())
    error *= sd / np.sqrt((np.abs(error) ** 2).mean())
    return MeasuredFrfs(
        freq,
        (values + error)[:, :, None],
        np.full((len(freq), 6, 1), sd**2),
        np.ones((6, 1), bool),
        OUTPUTS,
        (OUTPUTS[0],),
        2,
        1 / TAU,
    )


def test_as_many_lines_tell_as_one_as_the_correlation_of_windowed_noise_says() -> None:
    # E X_j conj(X_k) of white noise under a window is the Fourier sum of the window's square.
    window = np.exp(-np.arange(COUNT) * LENGTH / COUNT / TAU)
    covariance = np.fft.fft(window**2)
    alike = (np.abs(covariance / covariance[0]) ** 2).sum()
    assert measured(1).weight_by_variance().correlated_lines == pytest.approx(alike, rel=1e-3)


def test_intervals_hold_though_neighbouring_lines_err_alike() -> None:
    pulls = []
    for seed in range(50_000, 50_030):
        test = measured(seed)
        found = identify_modes(test.weight_by_variance(), test.freq_hz, roots=24)
        for freq, damping in zip(FREQ, DAMPING, strict=True):
            near = int(np.abs(found.fit.freq_hz - freq).argmin())
            pulls.append((found.fit.freq_hz[near] - freq) / found.freq_sd[near])
            pulls.append((found.fit.damping[near] - damping) / found.damping_sd[near])
    # 120 pulls: their rms is known to 6 %; without the correlation it would be above 2.
    assert 0.8 < np.sqrt(np.mean(np.square(pulls))) < 1.25


def test_the_misfit_is_the_noise_all_the_same() -> None:
    test = measured(7)
    assert identify_modes(
        test.weight_by_variance(), test.freq_hz, roots=24
    ).misfit == pytest.approx(1.0, abs=0.2)
