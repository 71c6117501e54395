"""Source of the variance of a campaign, which decides how far it is trusted."""

from identification.words import Campaign, VarianceSource


def find_variance_source(campaign: Campaign) -> VarianceSource:
    """Return where the noise's variance comes from; the worse source if there are two.

    A variance that the files state counts as one from coherences.
    """
    sources = {test.estimate.variance_source for test in campaign.tests}
    return "differences" if "differences" in sources else "coherence"
