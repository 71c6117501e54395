"""Parts of a campaign whose gains are known: checks of gain and sign apply to them alone."""

from dataclasses import replace

from identification.words import Campaign


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
        kept = [row for row, dof in enumerate(outputs) if dof.point not in unknown.sensors]
        if kept and not (hammers and test.condition.instrument in unknown.hammers):
            tests.append(replace(test, estimate=test.estimate.select_outputs(kept)))
    return replace(campaign, tests=tuple(tests)) if tests else None
