"""Check of the modes against the level of the hits: what is linear does not change with it."""

from identification.level_check.check import LevelCheck, check_hits, check_levels
from identification.level_check.decay_check import check_decay, track_decay
from identification.level_check.trends import group_visits

__all__ = [
    "LevelCheck",
    "check_decay",
    "check_hits",
    "check_levels",
    "group_visits",
    "track_decay",
]
