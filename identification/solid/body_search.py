"""Search for the faults of one body, among them those that its bending imitates."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.solid.body_channels import BodyData
from identification.solid.fault_search import FaultSearch, search_faults
from identification.solid.frequency_limit import ResidualSpectrum, residual_spectrum
from identification.solid.moments import Moments
from identification.solid.rigid_fit import fit_errors
from identification.solid.sensor_faults import BelievedBody, FaultHypothesis, Key
from identification.solid.shared_shape import block_residuals
from identification.words import Real, Tolerance

# Standard deviations of the residual's sum from which it decides about an exchange of channels.
_DECISIVE_SIGMA = 5.0


def search_body(data: BodyData, tolerance: Tolerance) -> FaultSearch:
    """Search for faults, without the opposite signs and exchanges that bending imitates.

    Above its resonance a body that twists moves one corner against its rigid motion, as an opposite
    sign would. But an opposite sign is an error of twice the motion on every line, so that lines
    below the resonance contradict it if it is not there.
    """
    search = search_faults(data, tolerance)
    imitated = list_imitated(search, tolerance)
    return search_faults(data, tolerance, imitated) if imitated else search


def list_imitated(search: FaultSearch, tolerance: Tolerance) -> frozenset[Key]:
    """Return the accepted signs and exchanges that the lowest lines contradict.

    The residual of nominal sensors is summed from the lowest line upwards, with and without each
    exchange. The first line at which the sums differ beyond noise decides (sequential test, Wald
    1945): there the body bends least.

    Args:
        search: search for the faults of a body.
    """
    exchanges = [fault.hypothesis for fault in search.accepted if fault.hypothesis.pairs]
    if not exchanges:
        return frozenset()
    model = BelievedBody.healthy(search.data, tolerance).model
    moments = Moments.of(search.data)

    def sum_residuals(corrected: Sequence[FaultHypothesis]) -> tuple[Real, Real]:
        exchanged = moments
        for hypothesis in corrected:
            exchanged = exchanged.exchange_channels(*hypothesis.channel_order(len(model.scale)))
        residual, expected = block_residuals(model, exchanged, np.zeros(model.sensors.count))
        return np.cumsum(residual), np.cumsum(expected)

    imitated = set()
    for exchange in exchanges:
        with_it, expected = sum_residuals(exchanges)
        without_it, _ = sum_residuals([each for each in exchanges if each is not exchange])
        evidence = (without_it - with_it) / np.sqrt(1 + expected)
        decisive = np.abs(evidence) > _DECISIVE_SIGMA
        if decisive.any() and evidence[np.argmax(decisive)] < 0:
            imitated.add(exchange.key)
    return frozenset(imitated)


def correct_spectrum(
    data: BodyData, tolerance: Tolerance, search: FaultSearch
) -> tuple[ResidualSpectrum, bool]:
    """Compute the residual along frequency with sensor faults corrected and flexible shapes kept.

    Returns:
        The residuals, and whether free shapes matter. They do not if the body is solid even with
            all shapes kept, dead channels excepted.
    """
    drawn, state = BelievedBody.healthy(data, tolerance), search.state
    shaped = [fault for fault in search.accepted if fault.frees_shape]
    moments = Moments.of(state.data, state.reading, blocks=1)
    errors = fit_errors(state.model, moments, start=search.errors, least=-np.inf).errors

    def residuals_without(left_out: list[bool]) -> ResidualSpectrum:
        model = replace(state.model, extra=state.extra[:, left_out])
        return residual_spectrum(state, drawn, model, errors, search.noise_scale)

    residuals = residuals_without([fault.dead for fault in shaped])
    if not residuals.exceeds_bound.any():
        return residuals, False
    return residuals_without([fault.hypothesis.effect != "flexible_body" for fault in shaped]), True
