r"""Noise at the lines of a force that repeats, and what leaks into them, by the lines between.

The spectrum of M periods at once holds the answer to the force at every M-th line. Between them lie
noise and leakage: a position that drifts, modes that still ring. Leakage is smooth along frequency.
A parabola through the lines about each line of the force gives the leakage there, which is taken
off, and their scatter about it the noise (robust local polynomial method, Pintelon and Schoukens
2012, ch. 7). A share h of the noise remains in the parabola, so that the variance is 1 + h times
that of the scatter.
"""

import numpy as np

from identification.words import Complex, Integers, Real

_LEAKAGE_DEGREE = 2
_MIN_NEXT_PERIODS = 4  # below which lines beyond the next ones of the force are needed too


def leakage_noise_factor(n_block: int) -> float:
    """Return 1 + h for a number of periods."""
    weights = _fit_parabola(n_block)[1][0]
    return 1 + float(weights @ weights)


def fit_leakage(whole: Complex, n_block: int, n_freq: int) -> tuple[Complex, Complex]:
    """Return the leakage at the lines of the force, and the covariance of noise without it.

    Args:
        whole: spectra of all periods at once, with negative frequencies; (n_whole, n_signal).
        n_block: number M of periods.
        n_freq: number of lines of the force, from 0 Hz.

    Returns:
        (n_freq, n_signal) and (n_freq, n_signal, n_signal).
    """
    offsets, inverse, columns = _fit_parabola(n_block)
    lines = n_block * np.arange(n_freq)[:, None] + offsets
    around = whole[lines % len(whole)]
    residual = around - np.einsum("ok,fks->fos", columns @ inverse, around)
    noise = np.einsum("fks,fkt->fst", residual, residual.conj()) / (len(offsets) - len(inverse))
    leakage = np.einsum("k,fks->fs", inverse[0], around)
    return np.asarray(leakage), np.asarray(leakage_noise_factor(n_block) * noise)


def _fit_parabola(n_block: int) -> tuple[Integers, Real, Real]:
    """Return offsets of lines, and the least squares of a polynomial and its columns there."""
    reach = n_block - 1 if n_block >= _MIN_NEXT_PERIODS else 2 * n_block - 1
    offsets = np.arange(-reach, reach + 1)
    offsets = offsets[offsets % n_block != 0]
    columns = np.stack([(offsets / reach) ** power for power in range(_LEAKAGE_DEGREE + 1)], axis=1)
    return offsets, np.linalg.pinv(columns), columns
