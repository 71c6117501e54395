"""Corrections of a campaign for faults of sensors: channels are masked, exchanged or divided."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.words import Campaign, Complex, Dof, FrfEstimate, Mask, Port, Real

Reading = Callable[[Real], Complex]


def match_channels(location: str, dof: str | None) -> Callable[[Port], bool]:
    """Return a function that says whether a fault concerns a channel.

    Args:
        location: ``sensor:<site>`` or ``sensor:<site>+<site>``.
        dof: such as ``tx`` or ``tx+ty``; None for all.
    """
    sites = location.partition(":")[2].split("+")
    axes = None if dof is None else dof.split("+")

    def concerns(channel: Port) -> bool:
        return channel.point in sites and (axes is None or channel.direction[1:] in axes)

    return concerns


def mask_channels(campaign: Campaign, concerns: Callable[[Port], bool]) -> Campaign:
    """Return the campaign without some channels, whose cells count as not measured."""

    def edit(estimate: FrfEstimate) -> FrfEstimate:
        kept = np.array([not concerns(dof) for dof in estimate.frf.outputs])
        return _keep_channels(estimate, kept)

    return _edit_estimates(campaign, edit)


def divide_channels(
    campaign: Campaign, concerns: Callable[[Port], bool], reading: Reading
) -> Campaign:
    """Return the campaign with some channels divided by their reading per motion."""

    def edit(estimate: FrfEstimate) -> FrfEstimate:
        rows = np.array([concerns(dof) for dof in estimate.frf.outputs])
        read = reading(estimate.frf.freq_hz)[:, None, None]
        values, variance = estimate.frf.values.copy(), estimate.variance.copy()
        values[:, rows] /= read
        variance[:, rows] /= np.abs(read) ** 2
        return replace(estimate, frf=replace(estimate.frf, values=values), variance=variance)

    return _edit_estimates(campaign, edit)


def exchange_channels(campaign: Campaign, pairs: tuple[tuple[Dof, Dof], ...]) -> Campaign:
    """Return the campaign with exchanged channels; a channel without its partner is masked."""
    partner: dict[Port, Port] = {a.positive: b.positive for a, b in pairs}
    partner |= {b.positive: a.positive for a, b in pairs}

    def edit(estimate: FrfEstimate) -> FrfEstimate:
        outputs = estimate.frf.outputs
        place = {dof.positive: row for row, dof in enumerate(outputs)}
        rows, signs = np.arange(len(outputs)), np.ones(len(outputs))
        kept = np.ones(len(outputs), bool)
        for row, dof in enumerate(outputs):
            counterpart = place.get(partner.get(dof.positive, dof.positive))
            kept[row] = counterpart is not None
            if counterpart is not None:
                rows[row] = counterpart
                signs[row] = dof.sign * outputs[counterpart].sign
        values = estimate.frf.values[:, rows] * signs[:, None]
        moved = replace(
            estimate,
            frf=replace(estimate.frf, values=values),
            variance=estimate.variance[:, rows],
            measured=estimate.measured[rows],
            coherence=None if estimate.coherence is None else estimate.coherence[:, rows],
        )
        return _keep_channels(moved, kept)

    return _edit_estimates(campaign, edit)


def _keep_channels(estimate: FrfEstimate, kept: Mask) -> FrfEstimate:
    frf = replace(estimate.frf, values=estimate.frf.values * kept[:, None])
    return replace(estimate, frf=frf, measured=estimate.measured & kept[:, None])


def _edit_estimates(campaign: Campaign, edit: Callable[[FrfEstimate], FrfEstimate]) -> Campaign:
    tests = tuple(replace(test, estimate=edit(test.estimate)) for test in campaign.tests)
    return replace(campaign, tests=tests)
