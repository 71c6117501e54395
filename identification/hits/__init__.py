"""Estimation of FRFs with their variance from time records of hammer hits."""

from identification.hits.detection import find_blows
from identification.hits.drive_point import drive_point_signs
from identification.hits.estimators import average_spectra, estimate_frf
from identification.hits.hit_frfs import estimate_hit_frf, estimate_hit_frfs
from identification.hits.settings import HitSettings

__all__ = [
    "HitSettings",
    "average_spectra",
    "drive_point_signs",
    "estimate_frf",
    "estimate_hit_frf",
    "estimate_hit_frfs",
    "find_blows",
]
