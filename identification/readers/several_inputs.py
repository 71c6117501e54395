"""Noise of FRFs whose inputs acted at once: their coherence is multiple, one for each output.

The multiple coherence of an output says how much of it all inputs explain together, so that every
reference of the file holds the same curve. The formula for one input would give a cell the noise of
the whole output over the share that one input drives.
"""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from identification.noise.variance import (
    implied_coherence,
    several_input_variance,
)
from identification.readers.frf_table import FrfTable
from identification.words import Complex, InputError, Real

CoherenceKind = Literal["ordinary", "multiple"]

# Coherences of several references that were hit one after the other differ by their noise, which is
# a large part of 1 - g2. Below 0.999 that is far above the 5 digits that files print at least.
_MAX_NOISY_COHERENCE, _MAX_PRINTED_DIFFERENCE = 0.999, 1e-5
_MIN_EQUAL_LINES = 4  # by chance not even one line of an output agrees to all digits
# Smallest over largest eigenvalue of the inputs' spectra in units of their own power: below it one
# input follows from the others, and no FRFs could be estimated.
_MIN_EIGENVALUE_SHARE = 1e-10
_MAX_ADJOINT_DIFFERENCE = (
    1e-3  # of S_xx against its conjugate transpose: rounding, not half a matrix
)


def resolve_several_inputs(
    file: Path, table: FrfTable, stated: CoherenceKind | None, averages: int | None
) -> FrfTable:
    """Return the table with the noise of each cell where several inputs acted at once.

    With the spectra S_xx of the inputs and the number of averages, each cell gets the ordinary
    coherence that its variance implies. Without them its variance comes from third differences.

    Args:
        file: file, for messages.
        table: FRFs with their checked coherence.
        stated: kind of the coherence by campaign.toml, or None.
        averages: number of averages, or None.

    Raises:
        InputError: coherences or spectra contradict the statement.
    """
    if table.coherence is None or table.variance is not None or stated == "ordinary":
        return table
    equal = _equal_outputs(table)
    has_spectra = table.input_spectra is not None
    if stated is None and not has_spectra and not equal.any():
        return table
    differing = _differing_outputs(table)
    if differing.any():
        if stated is None and not has_spectra:
            return table
        raise InputError(
            f"{file}: the coherence of {table.responses[int(np.argmax(differing))]} differs "
            "between references, so it is not multiple: export the multiple coherence, or set "
            'coherence = "ordinary"'
        )
    remarks = [] if stated else [_guess_sentence(file, table, equal)]
    with np.errstate(all="ignore"):
        multiple = np.nanmax(np.where(np.isnan(table.coherence), -1.0, table.coherence), axis=2)
    multiple = np.where(multiple < 0, np.nan, multiple)
    if table.input_spectra is not None and averages is not None:
        table = _with_cell_coherence(file, table, multiple, averages)
    else:
        missing = "their cross spectra (input_spectra)" if not has_spectra else "averages"
        remarks.append(
            f"{file.name}: several inputs acted at once, so that the noise of each FRF needs "
            f"{missing}; without, it is estimated from third differences along frequency"
        )
        coherence = np.broadcast_to(multiple[:, :, None], table.values.shape)
        table = replace(table, coherence=coherence, is_multiple=True)
    return replace(table, remarks=(*table.remarks, *remarks))


def _equal_outputs(table: FrfTable) -> np.ndarray:
    """Return for which outputs all references hold one noisy coherence; (n_out,)."""
    coherence = np.asarray(table.coherence)
    if coherence.shape[2] < 2:
        return np.zeros(coherence.shape[1], bool)
    noisy = (coherence < _MAX_NOISY_COHERENCE).all(axis=2)
    differs = ~(np.ptp(coherence, axis=2) <= _MAX_PRINTED_DIFFERENCE)  # also where one is NaN
    return np.asarray((noisy.sum(axis=0) >= _MIN_EQUAL_LINES) & ~(noisy & differs).any(axis=0))


def _differing_outputs(table: FrfTable) -> np.ndarray:
    """Return for which outputs the known coherences of two references differ; (n_out,)."""
    coherence = np.asarray(table.coherence)
    low = np.where(np.isnan(coherence), np.inf, coherence).min(axis=2)
    high = np.where(np.isnan(coherence), -np.inf, coherence).max(axis=2)
    return np.asarray((high - low > _MAX_PRINTED_DIFFERENCE).any(axis=0))


def _guess_sentence(file: Path, table: FrfTable, equal: np.ndarray) -> str:
    """Return why the coherence counts as multiple, and the key that says so."""
    if not equal.any():
        return (
            f"{file.name}: its coherence counts as multiple, since it holds the spectra of inputs: "
            'set coherence = "multiple" in its [[test]], or "ordinary" if it is not'
        )
    return (
        f"{file.name}: the coherence of {table.responses[int(np.argmax(equal))]} is equal for all "
        "references, as if several inputs acted at once, and counts as multiple: set "
        'coherence = "multiple" in its [[test]], or "ordinary" if it is not'
    )


def _with_cell_coherence(file: Path, table: FrfTable, multiple: Real, averages: int) -> FrfTable:
    """Return the table with the ordinary coherence that the variance of each cell implies."""
    spectra = np.asarray(table.input_spectra)
    if averages <= len(table.references):
        raise InputError(
            f"{file}: {averages} averages of {len(table.references)} inputs at once determine no "
            "FRFs: correct averages"
        )
    _check_spectra(file, table, spectra)
    variance = several_input_variance(table.values, multiple, spectra, averages)
    coherence = implied_coherence(table.values, variance, averages)
    return replace(table, coherence=coherence)


def _check_spectra(file: Path, table: FrfTable, spectra: Complex) -> None:
    """Refuse spectra of the inputs that are not Hermitian, or of which one follows from others."""
    sizes = np.einsum("fii->fi", spectra).real
    adjoint = spectra.conj().swapaxes(1, 2)
    for line, freq_hz in enumerate(table.freq_hz):
        remedy = f"at {freq_hz:g} Hz: save S_xx as the full matrix of averaged x_i conj(x_j)"
        if not (sizes[line] > 0).all():
            raise InputError(f"{file}: an input has no power in input_spectra {remedy}")
        unit = spectra[line] / np.sqrt(np.outer(sizes[line], sizes[line]))
        if (
            np.abs(spectra[line] - adjoint[line]).max()
            > _MAX_ADJOINT_DIFFERENCE * sizes[line].max()
        ):
            raise InputError(f"{file}: input_spectra is not Hermitian {remedy}")
        if np.linalg.eigvalsh(unit)[0] < _MIN_EIGENVALUE_SHARE:
            raise InputError(
                f"{file}: the inputs of input_spectra are fully correlated at {freq_hz:g} Hz, so "
                "that no FRFs follow: drive them with independent signals, or leave the line out"
            )
