"""Facts of a campaign that decide how it is fitted."""

from identification.words import Campaign, VarianceSource

MIN_FITTED_LINES = 96  # of a campaign that has them: 800 lines by a stride of 8


def count_measured_frfs(campaign: Campaign) -> int:
    """Return the number of FRFs."""
    return sum(int(test.estimate.measured.sum()) for test in campaign.tests)


def find_variance_source(campaign: Campaign) -> VarianceSource:
    """Return where the noise's variance comes from; the worse source if there are two."""
    sources = {test.estimate.variance_source for test in campaign.tests}
    return "coherence" if sources == {"coherence"} else "differences"


def choose_stride(lines: int, stride: int) -> int:
    """Return the stride of the lines that a fit counts: enough remain to see sharp modes.

    At least every second line stays unseen, which tells a gap by neighbouring lines.

    Args:
        lines: number of frequency lines.
        stride: wanted stride.
    """
    return max(2, min(stride, lines // MIN_FITTED_LINES))
