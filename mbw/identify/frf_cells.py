"""Coherence and rigid-body reconstruction of each measured FRF."""

from dataclasses import dataclass

import numpy as np

from identification import reconstruct, reduce_to_bodies
from identification.modal import MeasuredFrfs
from identification.roving_hammer import is_roving_hammer
from identification.words import Campaign, Complex, Layout, Mask, Real, Signal
from mbw.identify.body_frfs import measured_estimate


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
        campaign: campaign with its tests.
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
    reduced = reduce_to_bodies(measured_estimate(measured), layout)
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
