"""Table (response, reference) of the FRFs of one file, before nodes are matched to sites."""

from dataclasses import dataclass

from identification.words import Complex, Dof, Input, Mask, Quantity, Real


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
    """

    freq_hz: Real
    values: Complex
    coherence: Real | None
    measured: Mask
    responses: tuple[Dof, ...]
    references: tuple[Input, ...]
    quantity: Quantity
    remarks: tuple[str, ...] = ()
