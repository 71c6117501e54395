"""Table (response, reference) of the FRFs of one file, before nodes are matched to sites.

Check of the coherences of a file: numbers from 0 to 1 that say something about the noise.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.words import (
    Complex,
    Input,
    InputError,
    Mask,
    Output,
    Quantity,
    Real,
    percent_text,
)

_MAX_ZERO_LINE = 1e-3  # of the spacing: a lower first line stands for 0 Hz


@dataclass(frozen=True, eq=False)
class FrfTable:
    """FRFs of one file, in SI units, with points named by node number; convention exp(+i w t).

    Args:
        freq_hz: frequencies [Hz]; (n_freq,).
        values: FRFs, zero in cells that were not measured; (n_freq, n_out, n_in).
        coherence: coherence, NaN in cells without it, or None; (n_freq, n_out, n_in).
        measured: which cells were measured; (n_out, n_in).
        responses: degrees of freedom such as ``11:+tx``.
        references: degrees of freedom, or motors by their names.
        quantity: receptance, mobility or accelerance.
        remarks: sentences on the file, for example that it holds a record twice.
        variance: variance of the FRFs that the file states, or None; (n_freq, n_out, n_in).
        input_spectra: spectra S_ij of inputs that acted at once, the mean of x_i conj(x_j), up to a
            common factor, or None; (n_freq, n_in, n_in).
        is_multiple: whether the coherence is multiple, so that no variance follows from it.
    """

    freq_hz: Real
    values: Complex
    coherence: Real | None
    measured: Mask
    responses: tuple[Output, ...]
    references: tuple[Input, ...]
    quantity: Quantity
    remarks: tuple[str, ...] = ()
    variance: Real | None = None
    input_spectra: Complex | None = None
    is_multiple: bool = False


def set_zero_line(file: str, table: FrfTable) -> FrfTable:
    """Set a first line that stands for 0 Hz to 0 Hz, with a remark.

    Some programs write such a line as 1e-5 Hz, since a logarithmic axis has no zero.

    Args:
        file: name of the file, for the remark.
        table: FRFs of the file.
    """
    freq_hz = table.freq_hz
    if len(freq_hz) < 2 or not 0 < freq_hz[0] < _MAX_ZERO_LINE * (freq_hz[1] - freq_hz[0]):
        return table
    remark = f"{file}: its first line, {freq_hz[0]:g} Hz, counts as 0 Hz"
    first_at_zero = freq_hz.copy()
    first_at_zero[0] = 0.0
    return replace(table, freq_hz=first_at_zero, remarks=(*table.remarks, remark))


_MAX_ROUNDING = 1e-4  # beyond 0 or 1 that single precision and printed digits leave
_MAX_OUTSIDE_SHARE = 0.05  # share of values outside 0..1 that may be slips of an analyser
_MIN_PERCENT_MEDIAN = 1.5  # median of coherences in per cent: far above 1 if the test is any good
_MAX_PERCENT = 100.1  # with rounding
_MAX_EQUAL_SPREAD = 1e-9  # coherences from hits never agree so closely on all lines
_IMAGINARY_ROUNDING = 1e-6  # largest imaginary part of a coherence that was stored as complex


def real_coherence(name: str, values: np.ndarray) -> Real:
    """Return stored coherences as real numbers; beyond 0 or 1 by rounding they are 0 or 1.

    Args:
        name: file and element, for messages.
        values: coherences, perhaps with imaginary parts of zero; any shape.

    Raises:
        InputError: an imaginary part is not zero.
    """
    if np.iscomplexobj(values) and np.abs(values.imag).max(initial=0.0) > _IMAGINARY_ROUNDING:
        raise InputError(
            f"{name} is complex, but a coherence is a real number from 0 to 1: export |Sxf|^2 / "
            "(Sxx Sff), not the cross spectrum"
        )
    real = np.array(np.real(values), np.float64)
    for end, is_slip in ((0.0, real < 0.0), (1.0, real > 1.0)):
        real[is_slip & (np.abs(real - end) <= _MAX_ROUNDING)] = end
    return real


def check_coherence(file: Path, table: FrfTable) -> FrfTable:
    """Return the table with coherences from 0 to 1, NaN where they are unknown.

    The coherences come from ``real_coherence``.
    A coherence that is equal on every line, such as 1 from a single hit, says nothing about the
    noise and is removed. Values outside 0..1 count as unknown if they are few.

    Raises:
        InputError: the coherences are in per cent, or many of them lie outside 0..1.
    """
    if table.coherence is None:
        return table
    values = np.asarray(table.coherence)
    given = np.isfinite(values) & table.measured
    if not given.any():
        return table
    low, high = values.min(where=given, initial=np.inf), values.max(where=given, initial=-np.inf)
    if high - low < _MAX_EQUAL_SPREAD:
        return _without_coherence(file, table, float(values[given][0]))
    outside = ((values < 0) | (values > 1)) & table.measured
    if not outside.any():
        return table
    table = _without_slips(file, table, outside)
    return replace(table, coherence=np.where(outside, np.nan, values))


def _without_coherence(file: Path, table: FrfTable, value: float) -> FrfTable:
    """Return the table without a coherence that is equal on every line, with a remark."""
    why = "as from a single hit, " if np.isclose(value, 1.0) else ""
    remark = (
        f"{file.name}: its coherence is {value:.4g} on every line, {why}and is not used: the noise "
        "is estimated from third differences along frequency; export the coherence over all hits"
    )
    return replace(table, coherence=None, remarks=(*table.remarks, remark))


def _without_slips(file: Path, table: FrfTable, outside: np.ndarray) -> FrfTable:
    """Return the table with a remark on a few values outside 0..1; refuse many."""
    values = np.asarray(table.coherence)
    finite = values[np.isfinite(values) & table.measured]
    low, high = float(finite.min()), float(finite.max())
    if low >= 0 and high <= _MAX_PERCENT and np.median(finite) > _MIN_PERCENT_MEDIAN:
        raise InputError(
            f"{file}: its coherence reaches {high:.4g}, as in per cent: divide it by 100 and save "
            "it again"
        )
    line, row, column = (int(index) for index in np.argwhere(outside)[0])
    where = (
        f"{table.freq_hz[line]:g} Hz, response {table.responses[row]}, reference "
        f"{table.references[column]}"
    )
    share = float(outside.sum() / finite.size)
    if share > _MAX_OUTSIDE_SHARE:
        raise InputError(
            f"{file}: its coherence lies outside 0 to 1 in {percent_text(share)} of its values "
            f"({low:.4g} to {high:.4g}; first at {where}): export it again, or leave it out"
        )
    remark = (
        f"{file.name}: its coherence lies outside 0 to 1 in {int(outside.sum())} values "
        f"({low:.4g} to {high:.4g}; first at {where}), whose noise counts as unknown"
    )
    return replace(table, remarks=(*table.remarks, remark))
