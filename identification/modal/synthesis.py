"""FRFs from a modal model: between all outputs, and beside every measured one with its error."""

from dataclasses import dataclass, replace

import numpy as np

from identification.modal.campaign_modes import Measured
from identification.modal.indicators import frac
from identification.modal.shapes import Scaled
from identification.words import Complex, Mask, ModalModel, Real, UsageError, modal_sum

_RECIPROCAL = 0.8  # MAC of shape and participation at the drive points


def reciprocal(whole: Scaled, inside: int) -> Mask:
    """Which poles belong in the full matrix; (n_mode,).

    All modes inside the band, which come first; of the poles that stand for what lies beside it,
    those whose shape and participation agree at the drive points: the others are no single mode.

    Args:
        whole: modes with scaling.
        inside: number of modes inside the band.
    """
    chosen = np.arange(len(whole.model.poles)) < inside
    if len(whole.reciprocity):
        chosen |= whole.reciprocity >= _RECIPROCAL
    return chosen


def full_matrix(whole: Scaled, chosen: Mask | None = None) -> ModalModel:
    """The model whose inputs are all its outputs: its FRFs are the n x n matrix of eq. 3.6.

    Its participation is phi_r / a_r. Residuals are zero: they were only measured in the columns
    that were hit, so that the full matrix lacks part of what lies beside the band.

    Args:
        whole: n outputs, with scaling.
        chosen: which modes; all if None.

    Returns:
        n inputs; ``synthesise`` gives H_syn (seed, eq. 3.6 and 3.7), (n_freq, n, n).

    Raises:
        UsageError: no drive point, so no a_r.
    """
    if not whole.has_scale:
        raise UsageError(
            "no input is measured as an output too: without a drive point modes have no scale, "
            "and FRFs between other points cannot be synthesised"
        )
    model, n = whole.model, len(whole.model.outputs)
    kept = np.ones(len(model.poles), bool) if chosen is None else chosen
    return replace(
        model,
        poles=model.poles[kept],
        shapes=model.shapes[:, kept],
        participation=model.shapes[:, kept] / whole.modal_a[kept],
        freq_sd=model.freq_sd[kept],
        damping_sd=model.damping_sd[kept],
        lower=np.zeros((n, n)),
        upper=np.zeros((n, n)),
        inputs=model.outputs,
    )


@dataclass(frozen=True, eq=False)
class SynthesisError:
    """How a synthesis answers beside each measured FRF; (n_out, n_in) each, zero if not measured.

    Args:
        known: which were measured and do not vanish.
        error: ||H_syn - H|| / ||H|| over the band.
        noise: sqrt(sum of the variance) / ||H||: the error of a perfect model.
        frac: frequency response assurance criterion.
    """

    known: Mask
    error: Real
    noise: Real
    frac: Real


def synthesis_error(measured: Measured, values: Complex) -> SynthesisError:
    """Compare a synthesis with every measured FRF.

    Args:
        measured: what was measured.
        values: synthesised on its lines; (n_freq, n_out, n_in).
    """
    size = np.linalg.norm(measured.values, axis=0)
    known = measured.measured & (size > 0)
    safe = np.where(known, size, 1.0)
    return SynthesisError(
        known,
        np.where(known, np.linalg.norm(values - measured.values, axis=0) / safe, 0.0),
        np.where(known, np.sqrt(measured.variance.sum(axis=0)) / safe, 0.0),
        np.where(known, frac(measured.values, values), 0.0),
    )


def synthesised(model: ModalModel, measured: Measured) -> Complex:
    """The model on the lines of a measurement, with its window's decay; (n_freq, n_out, n_in)."""
    return modal_sum(model, measured.laplace, measured.order)
