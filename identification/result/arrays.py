"""Arrays of ``modes.npz``.

Coherence and rigid-body reconstruction of each measured FRF.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.modal import (
    IdentifiedModes,
    MeasuredFrfs,
    ModeCriteria,
    auto_mac,
    classify_pole_stability,
    cmif,
    mmif,
    select_reciprocal_modes,
    signed_comac,
)
from identification.result.hits import hits_arrays
from identification.result.parts import MAX_NOISE_RATIO, ResultParts
from identification.roving_hammer import is_roving_hammer
from identification.solid import reconstruct, reduce_to_bodies
from identification.words import Campaign, Complex, Layout, Mask, Real, Signal


def collect_arrays(parts: ResultParts, tolerances: ModeCriteria) -> dict[str, Any]:
    """Return all arrays by name; shapes are (n_out, n_mode), FRFs (n_freq, n_out, n_in).

    Args:
        parts: modal model and what follows from it.
    """
    return {
        **_model_arrays(parts),
        **_quality_arrays(parts),
        **_cell_arrays(parts),
        **hits_arrays(parts.campaign),
        **_diagram_arrays(parts.identified, tolerances),
        **_layout_arrays(parts.campaign.layout),
    }


def _model_arrays(parts: ResultParts) -> dict[str, Any]:
    """Return the modal model, its synthesised FRFs and the measured FRFs."""
    model, measured = parts.model, parts.measured
    return {
        "poles": model.poles,
        "shapes": model.shapes,
        "participation": model.participation,
        "modal_a": parts.scaled.modal_a,
        "lower": model.lower,
        "upper": model.upper,
        "freq_sd": model.freq_sd,
        "damping_sd": model.damping_sd,
        "in_full_matrix": select_reciprocal_modes(parts.scaled, parts.n_inside),
        "inside_band": np.arange(len(model.poles)) < parts.n_inside,
        "normalisation": np.array(parts.scaled.normalisation),
        "outputs": np.array([str(dof) for dof in model.outputs]),
        "inputs": np.array([str(dof) for dof in model.inputs]),
        "quantity": np.array(measured.quantity),
        "freq_hz": measured.freq_hz,
        "decay": np.array(measured.decay),
        "measured": measured.values,
        "noise_sd": np.sqrt(measured.variance).astype(np.float32),
        "synthesised": parts.synthesised,
        "is_measured": measured.measured,
        "real_shapes": parts.real_shapes,
        "body_shapes": parts.body_shapes.values,
        "body_directions": np.array([str(dof) for dof in parts.body_shapes.dofs]),
    }


def _cell_arrays(parts: ResultParts) -> dict[str, Any]:
    """Return coherence and rigid-body reconstruction of each measured FRF, in single precision."""
    cells = compute_frf_cells(parts.campaign, parts.measured)
    return {
        "coherence": cells.coherence.astype(np.float32),
        "has_coherence": cells.has_coherence,
        "as_solid": cells.solid.astype(np.complex64),
        "has_solid": cells.has_solid,
    }


def _quality_arrays(parts: ResultParts) -> dict[str, Any]:
    """Return synthesis errors, mode indicators and comparisons of shapes."""
    shapes, comparison = parts.model.shapes[:, : parts.n_inside], parts.comparison
    values, order = parts.measured.values, parts.measured.order
    is_quiet = parts.error.known & (parts.error.noise <= MAX_NOISE_RATIO)
    quiet = is_quiet.any(axis=1) & (parts.n_inside > 0)
    solid = np.zeros(len(shapes), bool)
    solid[parts.is_measured] = parts.body_shapes.solid
    comac = np.zeros(len(shapes))
    comac[parts.is_measured] = signed_comac(
        shapes[parts.is_measured], parts.body_shapes.reconstructed, parts.height
    )
    full_matrix = parts.full_matrix_error
    return {
        "channel_error": parts.error.error,
        "channel_noise": parts.error.noise,
        "channel_frac": parts.error.frac,
        "channel_reciprocal_error": (
            np.zeros((0, 0)) if full_matrix is None else full_matrix.error
        ),
        "cmif": cmif(values),
        "mmif": mmif(values * 1j if order == 1 else values),
        "auto_mac": auto_mac(parts.model.shapes),
        "comac_solid": np.where(solid & quiet, comac, 0.0),
        "is_solid": solid & quiet,
        "other_mac": comparison.mac,
        "other_freq_hz": comparison.reference.freq_hz,
        "other_damping": comparison.reference.damping,
        "other_pairs": np.array(comparison.pairs, np.intp).reshape(-1, 2),
        "comac_other": comparison.comac,
        "in_other": comparison.reference.has_shape & quiet,
    }


def _diagram_arrays(identified: IdentifiedModes, tolerances: ModeCriteria) -> dict[str, Any]:
    """Return the poles of all model orders with their kinds, for the stabilisation diagram."""
    orders = identified.orders
    kinds = classify_pole_stability(
        orders,
        frequency=tolerances.frequency,
        damping=tolerances.damping,
        participation=tolerances.participation,
        highest_damping=tolerances.highest_damping,
    )
    return {
        "diagram_order": np.repeat(
            [order.order for order in orders], [len(order.poles) for order in orders]
        ),
        "diagram_freq_hz": np.concatenate([order.freq_hz for order in orders]),
        "diagram_damping": np.concatenate([order.damping for order in orders]),
        "diagram_kind": np.concatenate(kinds),
    }


def _layout_arrays(layout: Layout) -> dict[str, Any]:
    return {
        "layout_bodies": np.array(layout.bodies),
        "layout_centres": layout.centres,
        "layout_points": np.array(layout.points),
        "layout_body_of": layout.body_of,
        "layout_positions": layout.positions,
        "layout_axes": layout.axes,
    }


@dataclass(frozen=True, eq=False)
class FrfCells:
    """Coherence and rigid-body reconstruction of FRFs; zero where an FRF has none.

    Args:
        coherence: ordinary coherence; (n_freq, n_out, n_in).
        has_coherence: whether an FRF has a coherence; (n_out, n_in).
        solid: reading of the channel if its body were solid; (n_freq, n_out, n_in).
        has_solid: whether an FRF has such a reconstruction; (n_out, n_in).
    """

    coherence: Real
    has_coherence: Mask
    solid: Complex
    has_solid: Mask


def compute_frf_cells(campaign: Campaign, measured: MeasuredFrfs) -> FrfCells:
    """Compute coherence and rigid-body reconstruction of every measured FRF.

    Args:
        measured: FRFs of all tests in one matrix; outputs are the hit points if the hammer roved.
    """
    coherence, has_coherence = _coherence(campaign, measured)
    solid, has_solid = _solid(measured, campaign.layout)
    return FrfCells(coherence, has_coherence, solid, has_solid)


def _coherence(campaign: Campaign, measured: MeasuredFrfs) -> tuple[Real, Mask]:
    """Return the coherence of each FRF from its test with the least variance."""
    roved = is_roving_hammer(campaign)
    moving = np.isin(campaign.freq_hz, measured.freq_hz)
    outputs, inputs = measured.outputs, measured.inputs
    values = np.zeros((len(measured.freq_hz), len(outputs), len(inputs)))
    least_variance = np.full(values.shape[1:], np.inf)
    has_coherence = np.zeros(values.shape[1:], bool)
    for test in campaign.tests:
        estimate, reference = test.estimate, test.condition.reference.positive
        if roved and isinstance(reference, Signal):  # left out: it has no reciprocal channel
            continue
        for row, dof in enumerate(estimate.frf.outputs):
            ends = (reference, dof.positive) if roved else (dof.positive, reference)
            cell = outputs.index(ends[0]), inputs.index(ends[1])
            total = estimate.variance[moving, row, 0].sum()
            if not estimate.measured[row, 0] or total >= least_variance[cell]:
                continue
            least_variance[cell], has_coherence[cell] = total, estimate.coherence is not None
            if estimate.coherence is not None:
                values[:, *cell] = estimate.coherence[moving, row, 0]
    return values * has_coherence, has_coherence


def _solid(measured: MeasuredFrfs, layout: Layout) -> tuple[Complex, Mask]:
    """Reduce the readings to six motions of each body, and compute the readings from these.

    A body needs at least one redundant channel: with six channels the reconstruction equals the
    measurement whatever the body does.
    """
    reduced = reduce_to_bodies(measured.estimate, layout)
    values, has_solid = np.zeros_like(measured.values), np.zeros_like(measured.measured)
    bodies = np.array([layout.owner_name(dof) for dof in measured.outputs])
    for body in layout.bodies:
        rows = np.flatnonzero(bodies == body)
        motions = [k for k, dof in enumerate(reduced.frf.outputs) if dof.point == body]
        if len(motions) < 6:
            continue
        is_redundant = measured.measured[rows].sum(axis=0) > 6
        is_known = measured.measured[rows] & reduced.measured[motions].all(axis=0) & is_redundant
        outputs = tuple(measured.outputs[k] for k in rows)
        values[:, rows] = reconstruct(reduced.frf, outputs, layout).values * is_known
        has_solid[rows] = is_known
    return values, has_solid
