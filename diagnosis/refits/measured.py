"""Properties of a campaign that decide how it is fitted."""

from diagnosis.settings import DiagnosisSettings
from identification.words import Campaign, VarianceSource


def count_measured_frfs(campaign: Campaign) -> int:
    """Return the number of FRFs."""
    return sum(int(test.estimate.measured.sum()) for test in campaign.tests)


def find_variance_source(campaign: Campaign) -> VarianceSource:
    """Return where the noise's variance comes from; the worse source if there are two.

    A variance that the files state counts as one from coherences.
    """
    sources = {test.estimate.variance_source for test in campaign.tests}
    return "differences" if "differences" in sources else "coherence"


def choose_stride(lines: int, stride: int, settings: DiagnosisSettings) -> int:
    """Return the stride of the lines that a fit counts, so that enough lines show sharp modes.

    At least every second line is left out, by which neighbouring lines show a gap.

    Args:
        lines: number of frequency lines.
        stride: wanted stride.
        settings: number of lines that remain.
    """
    return max(2, min(stride, lines // settings.min_fitted_lines))
