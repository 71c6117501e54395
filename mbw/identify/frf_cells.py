"""What stands beside each measured FRF: its coherence, and its body moving as a solid."""

from dataclasses import dataclass

import numpy as np

from identification import reconstruct, reduce_to_bodies
from identification.checks.roving_hammer import is_roved
from identification.modal import Measured
from identification.words import (
    ORDER,
    Campaign,
    Complex,
    Frf,
    FrfEstimate,
    Layout,
    Mask,
    Real,
)


@dataclass(frozen=True, eq=False)
class Cells:
    """Beside the measured FRFs; zero where there is none.

    Args:
        coherence: ordinary coherence; (n_freq, n_out, n_in).
        has_coherence: (n_out, n_in).
        solid: what the channel would read if its body were solid; (n_freq, n_out, n_in).
        has_solid: (n_out, n_in).
    """

    coherence: Real
    has_coherence: Mask
    solid: Complex
    has_solid: Mask


def cells_of(campaign: Campaign, measured: Measured) -> Cells:
    """Coherence and rigid reconstruction of every measured FRF.

    Args:
        campaign: its tests.
        measured: the same side by side; exchanged if the hammer roved.
    """
    coherence, known = _coherence(campaign, measured)
    solid, rebuilt = _solid(measured, campaign.layout)
    return Cells(coherence, known, solid, rebuilt)


def _coherence(campaign: Campaign, measured: Measured) -> tuple[Real, Mask]:
    """Of the test that each cell was taken from: of several, the one with the least variance."""
    roved = is_roved(campaign)
    moving = np.isin(campaign.freq_hz, measured.freq_hz)
    outputs, inputs = measured.outputs, measured.inputs
    values = np.zeros((len(measured.freq_hz), len(outputs), len(inputs)))
    least = np.full(values.shape[1:], np.inf)
    known = np.zeros(values.shape[1:], bool)
    for test in campaign.tests:
        estimate, reference = test.estimate, test.condition.reference.positive
        for row, dof in enumerate(estimate.frf.outputs):
            ends = (reference, dof.positive) if roved else (dof.positive, reference)
            cell = outputs.index(ends[0]), inputs.index(ends[1])
            total = estimate.variance[moving, row, 0].sum()
            if not estimate.measured[row, 0] or total >= least[cell]:
                continue
            least[cell], known[cell] = total, estimate.coherence is not None
            if estimate.coherence is not None:
                values[:, *cell] = estimate.coherence[moving, row, 0]
    return values * known, known


def _solid(measured: Measured, layout: Layout) -> tuple[Complex, Mask]:
    """Readings reduced to the six motions of each body, and what those would read again.

    Only where all six are determined and the body has a channel to spare: with six channels the
    reconstruction is the measurement, whatever the body does.
    """
    quantity = next(name for name, order in ORDER.items() if order == measured.order)
    frf = Frf(measured.freq_hz, measured.values, measured.outputs, measured.inputs, quantity)
    estimate = FrfEstimate(frf, measured.variance, "differences", measured.measured)
    reduced = reduce_to_bodies(estimate, layout)
    values, known = np.zeros_like(measured.values), np.zeros_like(measured.measured)
    bodies = np.array([layout.body_name(dof.point) for dof in measured.outputs])
    for body in layout.bodies:
        rows = np.flatnonzero(bodies == body)
        motions = [k for k, dof in enumerate(reduced.frf.outputs) if dof.point == body]
        if len(motions) < 6:
            continue
        spare = measured.measured[rows].sum(axis=0) > 6
        there = measured.measured[rows] & reduced.measured[motions].all(axis=0) & spare
        outputs = tuple(measured.outputs[k] for k in rows)
        values[:, rows] = reconstruct(reduced.frf, outputs, layout).values * there
        known[rows] = there
    return values, known
