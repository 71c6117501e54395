"""From hits to FRFs: records of force and motion in, estimates with their variance out."""

from identification.hits.drive_point import DrivePoint, drive_point_signs
from identification.hits.estimate import estimate, estimate_all
from identification.hits.estimators import Averages, average, estimate_frf
from identification.hits.find import find_blows
from identification.hits.settings import HitSettings

__all__ = [
    "Averages",
    "DrivePoint",
    "HitSettings",
    "average",
    "drive_point_signs",
    "estimate",
    "estimate_all",
    "estimate_frf",
    "find_blows",
]
