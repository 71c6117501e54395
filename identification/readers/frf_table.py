"""Table (response, reference) of the FRFs of one file, before nodes are matched to sites."""

from dataclasses import dataclass, replace

from identification.words import Complex, Input, Mask, Output, Quantity, Real

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
