"""Impacts without a measured force: records with clocks of their own, spectra."""

from identification.impacts.campaign import ImpactCampaign, read_impacts
from identification.impacts.common_clock import Struck, struck
from identification.impacts.records import ImpactRecord, Stamped, impact_record, read_impact
from identification.impacts.spectra import ImpactSpectra, impact_spectra, smoothed

__all__ = [
    "ImpactCampaign",
    "ImpactRecord",
    "ImpactSpectra",
    "Stamped",
    "Struck",
    "impact_record",
    "impact_spectra",
    "read_impact",
    "read_impacts",
    "smoothed",
    "struck",
]
