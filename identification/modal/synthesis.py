"""FRFs synthesised from a modal model, between all outputs, and their errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.modal.campaign_modes import MeasuredFrfs
from identification.modal.indicators import frac
from identification.modal.shapes import ScaledModes
from identification.words import (
    Complex,
    Dof,
    Layout,
    Mask,
    ModalModel,
    Port,
    Real,
    UsageError,
    modal_sum,
)

# MAC of shape and participation at the drive points above which a pole is one reciprocal mode.
_MIN_RECIPROCITY_MAC = 0.8
_MIN_PARALLEL_COSINE = 0.999  # within 2.5 degrees, beyond which sensors are set up askew


def select_reciprocal_modes(whole: ScaledModes, inside: int) -> Mask:
    """Select the poles of the full FRF matrix; (n_mode,).

    All modes inside the band, which come first, are selected. Of the poles that stand for the
    response outside the band, those are selected whose shape and participation agree at the drive
    points: the others are no single mode.

    Args:
        whole: modes with scaling.
        inside: number of modes inside the band.
    """
    chosen = np.arange(len(whole.model.poles)) < inside
    if len(whole.reciprocity):
        chosen |= whole.reciprocity >= _MIN_RECIPROCITY_MAC
    return chosen


def missing_drive_point_sentence(
    layout: Layout, outputs: Sequence[Port], inputs: Sequence[Port]
) -> str:
    """Return why shapes have no scale, and how they get one, where no input is an output.

    A hit and a sensor on one body along parallel axes are a drive point if the body does not turn,
    which shapes alone do not tell.

    Args:
        layout: points and their bodies.
        inputs: references.
    """
    points = set(layout.points)
    hits, sensors = (
        [dof for dof in dofs if isinstance(dof, Dof) and dof.point in points]
        for dofs in (inputs, outputs)
    )
    pairs = [
        (hit, sensor)
        for hit in hits
        for sensor in sensors
        if layout.owner_name(hit) == layout.owner_name(sensor)
        and abs(_axes_cosine(layout, hit, sensor)) > _MIN_PARALLEL_COSINE
    ]
    opening = "No input is measured as an output"
    if not pairs:
        return (
            f"{opening} too: without a drive point shapes have no scale, and only the measured "
            "columns of the FRF matrix can be synthesised."
        )
    hit, sensor = pairs[0]
    sign = sensor.sign * (1 if _axes_cosine(layout, hit, sensor) > 0 else -1)
    name = f"{sensor.point}:{'+' if sign > 0 else '-'}{sensor.direction[1:]}"
    return (
        f"{opening} at its own point: {hit} is hit and {sensor} is read, apart on the one body "
        f"{layout.owner_name(hit)}. Without a drive point shapes have no scale. If that body is "
        f"rigid and does not turn, state {hit} as {name} in campaign.toml; else put a sensor "
        "where it is hit."
    )


def _axes_cosine(layout: Layout, first: Dof, second: Dof) -> float:
    """Return the cosine between two translations of one body; 0 with a rotation."""
    if first.is_rotation or second.is_rotation:
        return 0.0
    rows = layout.rows((first, second)).reshape(2, -1, 6)[:, :, :3].reshape(2, -1)
    return float(rows[0] @ rows[1])


def full_matrix_model(whole: ScaledModes, chosen: Mask | None = None) -> ModalModel:
    """Return the modal model whose inputs are all its outputs: its FRFs are the n x n matrix.

    Its participation is phi_r / a_r (eq. 3.6). Its residuals are zero, since they were measured
    only in the columns of the real inputs. So the full matrix lacks part of the response outside
    the band.

    Args:
        whole: n outputs, with scaling.
        chosen: which modes; all if None.

    Returns:
        Model with n inputs; ``ModalModel.synthesise`` gives H_syn (seed, eq. 3.6 and 3.7), (n_freq,
            n, n).

    Raises:
        UsageError: no drive point, so no a_r.
    """
    if not whole.has_scale:
        raise UsageError(
            "no input is measured as an output at its own point and direction: without such a "
            "drive point modes have no scale, and FRFs between other points cannot be "
            "synthesised; put a sensor at a point that is hit, or state both at one site where "
            "their body moves them alike"
        )
    model, n = whole.model, len(whole.model.outputs)
    selected = np.ones(len(model.poles), bool) if chosen is None else chosen
    return replace(
        model,
        poles=model.poles[selected],
        shapes=model.shapes[:, selected],
        participation=model.shapes[:, selected] / whole.modal_a[selected],
        freq_sd=model.freq_sd[selected],
        damping_sd=model.damping_sd[selected],
        lower=np.zeros((n, n)),
        upper=np.zeros((n, n)),
        inputs=model.outputs,
    )


@dataclass(frozen=True, eq=False)
class SynthesisError:
    """Error of a synthesis at each measured FRF; (n_out, n_in) each, zero if not measured.

    Args:
        known: which FRFs were measured and do not vanish.
        error: ||H_syn - H|| / ||H|| over the band.
        noise: sqrt(sum of the variance) / ||H||: the error of a perfect model.
        frac: frequency response assurance criterion.
    """

    known: Mask
    error: Real
    noise: Real
    frac: Real


def synthesis_error(measured: MeasuredFrfs, values: Complex) -> SynthesisError:
    """Compare a synthesis with every measured FRF.

    Args:
        measured: measured FRFs.
        values: FRFs synthesised on their lines; (n_freq, n_out, n_in).
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


def synthesise_frfs(model: ModalModel, measured: MeasuredFrfs) -> Complex:
    """Synthesise FRFs on the lines of a measurement, with the decay of its window.

    Args:
        model: modes and residuals.
        measured: lines, quantity and window.

    Returns:
        H; (n_freq, n_out, n_in).
    """
    return modal_sum(model, measured.laplace, measured.order)
