"""From hits to FRFs: records of force and motion in, estimates with their variance out."""

from identification.hits.detection import find_blows
from identification.hits.drive_point import DrivePoint, drive_point_signs
from identification.hits.estimators import Averages, average, estimate_frf
from identification.hits.hit_frfs import estimate, estimate_all
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
