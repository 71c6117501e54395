"""Parts of a campaign whose gains are known: checks of gain and sign apply to them alone."""

from dataclasses import replace

import numpy as np

from identification.words import Campaign, Mask, Test


def leave_out_unknown_gains(campaign: Campaign, *, hammers: bool = True) -> Campaign | None:
    """Return the campaign without channels and tests of unknown gain; None if nothing is left.

    Args:
        campaign: any campaign.
        hammers: whether tests are left out too whose force channel has an unknown gain. Channels
            compared within one test do not need it.
    """
    unknown = campaign.unknown_gains
    if not unknown:
        return campaign
    tests = []
    for test in campaign.tests:
        outputs = test.estimate.frf.outputs
        has_known_gain = np.array([dof.point not in unknown.sensors for dof in outputs])
        if not has_known_gain.any() or (hammers and test.condition.instrument in unknown.hammers):
            continue
        tests.append(test if has_known_gain.all() else _select_channels(test, has_known_gain))
    return replace(campaign, tests=tuple(tests)) if tests else None


def _select_channels(test: Test, kept: Mask) -> Test:
    """Return a test with some of its channels."""
    estimate = test.estimate
    outputs = tuple(dof for dof, keep in zip(estimate.frf.outputs, kept, strict=True) if keep)
    selected = replace(
        estimate,
        frf=replace(estimate.frf, values=estimate.frf.values[:, kept], outputs=outputs),
        variance=estimate.variance[:, kept],
        measured=estimate.measured[kept],
        coherence=None if estimate.coherence is None else estimate.coherence[:, kept],
    )
    return replace(test, estimate=selected)
