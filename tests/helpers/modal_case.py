"""Synthetic FRFs of a machine of 36 modes, drawn from a seed."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Case:
    """What was drawn: FRFs with and without noise, and the modes inside the band."""

    freq_hz: np.ndarray
    clean: np.ndarray
    noisy: np.ndarray
    sd: np.ndarray
    modes_hz: np.ndarray
    damping: np.ndarray
    poles: np.ndarray
    shapes: np.ndarray
    drives: np.ndarray


def modal_case(
    seed,
    count,
    *,
    total=36,
    n_out=69,
    n_in=3,
    highest_damping=0.037,
    noise=0.01,
    lines=801,
    start=20,
    modes_hz=None,
    damping=None,
    spread=0.0,
):
    """Accelerances in 0..200 Hz, modes in 6..194 Hz at least 0.4 Hz apart, the others above.

    With a spread some modes are excited and measured far less than others (shapes times
    exp(spread N(0, 1))). Noise is complex normal, a share of each channel's rms over the band.
    """
    rng = np.random.default_rng(seed)
    inside = np.sort(rng.uniform(6, 194, count))
    while count > 1 and np.diff(inside).min() < 0.4:
        inside = np.sort(rng.uniform(6, 194, count))
    freq = np.concatenate([inside, np.sort(rng.uniform(215, 450, total - count))])
    zeta = rng.uniform(0.0035, highest_damping, total)
    if modes_hz is not None:
        freq[: len(modes_hz)], zeta[: len(modes_hz)] = modes_hz, damping
    shapes = rng.normal(size=(n_out, total)) * np.exp(0.1j * rng.normal(size=(n_out, total)))
    if spread:
        shapes *= np.exp(spread * rng.normal(size=total))
    drives = np.arange(30 % n_out, 30 % n_out + n_in)
    omega = 2 * np.pi * freq
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    scaled = shapes / np.sqrt(2j * poles.imag)  # a_r = 1
    axis = np.linspace(0, 200, lines)[start:]
    s = 2j * np.pi * axis
    residues = scaled[:, None, :] * scaled[drives]
    clean = np.tensordot(1 / (s[:, None] - poles), residues, (1, 2))
    clean = clean + np.tensordot(1 / (s[:, None] - poles.conj()), residues.conj(), (1, 2))
    clean = clean * (s**2)[:, None, None]
    sd = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
    error = rng.normal(size=(2, *clean.shape)) / np.sqrt(2) * sd
    return Case(
        axis,
        clean,
        clean + error[0] + 1j * error[1],
        sd,
        freq[:count],
        zeta[:count],
        poles,
        scaled,
        drives,
    )


def found_and_extra(case, freq_hz, damping):
    """True modes found within 1 % of frequency and 20 % of damping, and modes that are none."""
    near = np.abs(freq_hz[:, None] / case.modes_hz - 1) <= 0.01
    near &= np.abs(damping[:, None] / case.damping - 1) <= 0.2
    return int(near.any(axis=0).sum()), int((~near.any(axis=1)).sum())
