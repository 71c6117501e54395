r"""Compression of FRFs of many channels to the few combinations that stand above the noise.

The channels of a machine with m modes move in at most 2 m patterns, Re and Im of each shape, and in
those of its residual terms. Let T be a real matrix whose rows are orthonormal once the noise of
each channel is scaled to one. The model of ``shape_fit`` holds for T H as for H, with the shapes
T phi, since T is real: poles and participation are the same. Rows of T are the principal components

    Re sum_w H H^H = V diag(lambda) V^T

of sub-bands whose eigenvalues exceed those of noise alone. For n channels and N values of each, of
variance v, these end at v (1 + sqrt(n / N))^2 (Marchenko and Pastur 1967). The combinations that
are left out hold noise, which tells nothing of poles: this is a fit to the signal subspace (Viberg
and Ottersten 1991). Shapes are fitted to all channels afterwards.
"""

from dataclasses import replace

import numpy as np

from identification.modal.shape_fit import WeightedFrfs
from identification.words import Real

# FRFs below this number of values are fitted as they are: six times the usual 69 x 3 x 801.
MAX_WHOLE_VALUES = 1_000_000
# Sub-bands: a mode that is weak over the whole band may stand out in its own.
_N_SUB_BANDS = 16
_N_SCALINGS = 3  # sweeps in which the noise of channels is scaled to one
_LEAST_POWER = 1e-300  # avoids a division by zero
# Channels per combination from which compression pays; beyond it the FRFs stay as they are.
_MIN_RATIO = 2


def compress_channels(data: WeightedFrfs) -> WeightedFrfs:
    """Return the combinations of channels that stand above the noise, with their weights.

    FRFs of few values stay as they are. So do those in which a cell was not measured, since a
    combination needs all its channels, and those whose modes move the channels in too many ways.

    Args:
        data: FRFs, and weights of one over their variance.
    """
    if data.values.size <= MAX_WHOLE_VALUES or not data.separable or not data.cells.all():
        return data
    grams = _sub_band_grams(data)
    combinations = _signal_combinations(grams, data.values.shape[2])
    if not 0 < combinations.shape[1] * _MIN_RATIO <= len(data.cells):
        return data
    values = np.stack([cells @ combinations for cells in np.moveaxis(data.values, 2, 0)], axis=2)
    return replace(data, values=values, cells=1 / ((combinations**2).T @ (1 / data.cells)))


def _sub_band_grams(data: WeightedFrfs) -> list[tuple[int, Real]]:
    """Return the number of lines and Re sum H H^H of each sub-band; (n_out, n_out).

    Lines and references are weighted by their noise, that of a reference in the geometric mean.
    """
    weights = np.sqrt(data.weights[:, :, 0])
    columns = np.exp(np.log(data.cells).mean(axis=0) / 2)
    grams = []
    for lines in np.array_split(np.arange(len(data.laplace)), _N_SUB_BANDS):
        gram = np.zeros((len(data.cells), len(data.cells)))
        for inp, column in enumerate(columns):
            block = data.values[lines, :, inp] * (weights[lines] * column)
            gram += block.real.T @ block.real + block.imag.T @ block.imag
        grams.append((len(lines), gram))
    return grams


def _signal_combinations(grams: list[tuple[int, Real]], n_in: int) -> Real:
    """Return the combinations of channels that hold signal; (n_out, n_combination).

    Each sub-band counts with the energy of its signal: eigenvalues less those of noise. What no
    sub-band shows above its noise is left out of the sum. The noise of each channel is what the
    signal leaves of it, so that wrong weights do not look like signal (principal factors).
    """
    n_out = len(grams[0][1])
    noise = sum(np.diag(gram) for _, gram in grams)
    scale = np.ones(n_out)
    for _ in range(_N_SCALINGS):
        scale = scale / np.sqrt(np.maximum(noise, _LEAST_POWER))
        energy, noise, limit = np.zeros((n_out, n_out)), np.zeros(n_out), np.inf
        for n_lines, gram in grams:
            count = n_lines * n_in
            sizes, vectors = np.linalg.eigh(gram * np.outer(scale, scale) / count)
            level = float(np.median(sizes))
            edge = level * (1 + np.sqrt(n_out / count)) ** 2
            signal = sizes > edge
            rest = vectors[:, ~signal]
            noise += (rest**2 @ sizes[~signal]) / (rest**2).sum(axis=1) / level
            shown = vectors[:, signal] * (sizes[signal] / level - 1)
            energy += count * shown @ vectors[:, signal].T
            limit = min(limit, count * (edge / level - 1))
    sizes, vectors = np.linalg.eigh(energy)
    return scale[:, None] * np.asarray(vectors[:, sizes > limit], np.float64)
