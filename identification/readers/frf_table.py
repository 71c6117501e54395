"""The (response, reference) table of one file before its nodes are matched to sites."""

from dataclasses import dataclass

from identification.words import Complex, Dof, Mask, Quantity, Real


@dataclass(frozen=True, eq=False)
class FrfTable:
    """FRFs of one file, in SI and exp(+i w t), points still named by node number.

    Args:
        freq_hz: (n_freq,) [Hz].
        values: zeros where not measured; (n_freq, n_out, n_in).
        coherence: likewise, NaN in cells that the file has none for; or None.
        measured: (n_out, n_in).
        responses, references: such as ``11:+tx``.
        quantity: receptance, mobility or accelerance.
        remarks: what a reader must know, as records that are there twice.
    """

    freq_hz: Real
    values: Complex
    coherence: Real | None
    measured: Mask
    responses: tuple[Dof, ...]
    references: tuple[Dof, ...]
    quantity: Quantity
    remarks: tuple[str, ...] = ()
