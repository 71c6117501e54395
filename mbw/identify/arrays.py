"""Arrays of ``modes.npz``."""

from typing import Any

import numpy as np

from identification.modal import (
    IdentifiedModes,
    ModeCriteria,
    auto_mac,
    classify_pole_stability,
    cmif,
    mmif,
    select_reciprocal_modes,
    signed_comac,
)
from identification.words import Layout
from mbw.identify.frf_cells import compute_frf_cells
from mbw.identify.hits import hits_arrays
from mbw.identify.result_parts import MAX_NOISE_RATIO, ResultParts


def collect_arrays(parts: ResultParts, tolerances: ModeCriteria) -> dict[str, Any]:
    """Return all arrays by name; shapes are (n_out, n_mode), FRFs (n_freq, n_out, n_in).

    Args:
        parts: modal model and what follows from it.
        tolerances: criteria of the stabilisation diagram.
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
        "quantity": np.array(parts.quantity),
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
