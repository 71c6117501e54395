"""Facts of a campaign that decide how it is fitted."""

from identification.words import Campaign, VarianceSource


def measured_frfs(campaign: Campaign) -> int:
    """Return the number of FRFs."""
    return sum(int(test.estimate.measured.sum()) for test in campaign.tests)


def variance_source(campaign: Campaign) -> VarianceSource:
    """Return where the noise's variance comes from; the worse source if there are two."""
    sources = {test.estimate.variance_source for test in campaign.tests}
    return "coherence" if sources == {"coherence"} else "differences"
