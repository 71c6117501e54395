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


def unknown_gain_sentences(campaign: Campaign) -> list[str]:
    """Return what unknown gains mean for a modal model, which is identified without them."""
    unknown, sentences = campaign.unknown_gains, list[str]()
    how = (
        "are divided by an estimate from the nominal model"
        if unknown.nominal
        else "stand as they were read"
    )
    if unknown.sensors:
        sentences.append(
            f"the gain of {', '.join(sorted(unknown.sensors))} is unknown: its FRFs {how}, and the "
            "check of solid bodies leaves it out; mbw tune finds the gain"
        )
    if unknown.hammers:
        sentences.append(
            f"the gain of the force channel {', '.join(sorted(unknown.hammers))} is unknown: its "
            f"FRFs {how}, so that the scale of mode shapes is not measured, and no drive point is "
            "checked; mbw tune finds the gain"
        )
    return sentences
