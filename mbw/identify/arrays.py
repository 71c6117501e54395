"""The numbers of ``modes.npz``."""

from typing import Any

import numpy as np

from identification.modal import (
    Identified,
    Tolerances,
    auto_mac,
    cmif,
    mmif,
    reciprocal,
    signed_comac,
    stability,
)
from identification.words import Layout
from mbw.identify.frf_cells import cells_of
from mbw.identify.hits import hits_arrays
from mbw.identify.result_parts import QUIET, Parts


def arrays_of(parts: Parts, tolerances: Tolerances) -> dict[str, Any]:
    """All arrays by their names; shapes are (n_out, n_mode), FRFs (n_freq, n_out, n_in).

    Args:
        parts: of the modal model.
        tolerances: of the stabilisation.
    """
    return {
        **_model_arrays(parts),
        **_quality(parts),
        **_beside(parts),
        **hits_arrays(parts.campaign),
        **_diagram(parts.found, tolerances),
        **_layout(parts.campaign.layout),
    }


def _model_arrays(parts: Parts) -> dict[str, Any]:
    """The model in full, and how it answers beside what was measured."""
    model, measured = parts.model, parts.measured
    return {
        "poles": model.poles,
        "shapes": model.shapes,
        "participation": model.participation,
        "modal_a": parts.whole.modal_a,
        "lower": model.lower,
        "upper": model.upper,
        "freq_sd": model.freq_sd,
        "damping_sd": model.damping_sd,
        "in_full_matrix": reciprocal(parts.whole, parts.inside),
        "inside_band": np.arange(len(model.poles)) < parts.inside,
        "normalisation": np.array(parts.whole.normalisation),
        "outputs": np.array([str(dof) for dof in model.outputs]),
        "inputs": np.array([str(dof) for dof in model.inputs]),
        "quantity": np.array(parts.quantity),
        "freq_hz": measured.freq_hz,
        "decay": np.array(measured.decay),
        "measured": measured.values,
        "noise_sd": np.sqrt(measured.variance).astype(np.float32),
        "synthesised": parts.values,
        "is_measured": measured.measured,
        "real_shapes": parts.real,
        "body_shapes": parts.bodies.values,
        "body_directions": np.array([str(dof) for dof in parts.bodies.dofs]),
    }


def _beside(parts: Parts) -> dict[str, Any]:
    """Of each measured FRF its coherence, and its body moving as a solid; single precision."""
    cells = cells_of(parts.campaign, parts.measured)
    return {
        "coherence": cells.coherence.astype(np.float32),
        "has_coherence": cells.has_coherence,
        "as_solid": cells.solid.astype(np.complex64),
        "has_solid": cells.has_solid,
    }


def _quality(parts: Parts) -> dict[str, Any]:
    shapes, beside = parts.model.shapes[:, : parts.inside], parts.compared
    values, order = parts.measured.values, parts.measured.order
    quiet = (parts.error.known & (parts.error.noise <= QUIET)).any(axis=1) & (parts.inside > 0)
    solid = np.zeros(len(shapes), bool)
    solid[parts.seen] = parts.bodies.solid
    comac = np.zeros(len(shapes))
    comac[parts.seen] = signed_comac(shapes[parts.seen], parts.bodies.rebuilt, parts.height)
    alone = parts.alone
    return {
        "channel_error": parts.error.error,
        "channel_noise": parts.error.noise,
        "channel_frac": parts.error.frac,
        "channel_reciprocal_error": np.zeros((0, 0)) if alone is None else alone.error,
        "cmif": cmif(values),
        "mmif": mmif(values * 1j if order == 1 else values),
        "auto_mac": auto_mac(parts.model.shapes),
        "comac_solid": np.where(solid & quiet, comac, 0.0),
        "is_solid": solid & quiet,
        "other_mac": beside.mac,
        "other_freq_hz": beside.other.freq_hz,
        "other_damping": beside.other.damping,
        "other_pairs": np.array(beside.pairs, np.intp).reshape(-1, 2),
        "comac_other": beside.comac,
        "in_other": beside.other.there & quiet,
    }


def _diagram(found: Identified, tolerances: Tolerances) -> dict[str, Any]:
    """Poles of all orders side by side, for the stabilisation diagram."""
    kinds = stability(
        found.orders,
        frequency=tolerances.frequency,
        damping=tolerances.damping,
        participation=tolerances.participation,
        highest_damping=tolerances.highest_damping,
    )
    return {
        "diagram_order": np.repeat(
            [order.order for order in found.orders], [len(order.poles) for order in found.orders]
        ),
        "diagram_freq_hz": np.concatenate([order.freq_hz for order in found.orders]),
        "diagram_damping": np.concatenate([order.damping for order in found.orders]),
        "diagram_kind": np.concatenate(kinds),
    }


def _layout(layout: Layout) -> dict[str, Any]:
    return {
        "layout_bodies": np.array(layout.bodies),
        "layout_centres": layout.centres,
        "layout_points": np.array(layout.points),
        "layout_body_of": layout.body_of,
        "layout_positions": layout.positions,
        "layout_axes": layout.axes,
    }
