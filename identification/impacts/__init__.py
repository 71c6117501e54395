"""Impact tests with unmeasured force: channels with clocks of their own, and spectra."""

from identification.impacts.campaign import ImpactCampaign, read_impacts
from identification.impacts.common_clock import synchronise
from identification.impacts.records import ImpactRecord, impact_record, read_impact
from identification.impacts.spectra import ImpactSpectra, impact_spectra, sliding_average

__all__ = [
    "ImpactCampaign",
    "ImpactRecord",
    "ImpactSpectra",
    "impact_record",
    "impact_spectra",
    "read_impact",
    "read_impacts",
    "sliding_average",
    "synchronise",
]
