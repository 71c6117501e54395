"""Matching of measured modes to simulated ones: by likelihood, and by the ratios of the paper."""

from identification.matching.hand_methods import HandEstimate, estimate_by_hand
from identification.matching.likelihood import MatchingPriors, pairing_odds
from identification.matching.measured_modes import ImpactModes, impact_modes, rotate_to_real
from identification.matching.mode_circles import ChannelCircle, ModeCircles, fit_mode_circles
from identification.matching.mode_matching import (
    ModeMatch,
    best_matching,
    channel_geometry,
    match_modes,
    pair_probabilities,
    shapes_at_channels,
)
from identification.matching.ratio_method import (
    RatioReference,
    choose_reference,
    match_by_ratios,
)

__all__ = [
    "ChannelCircle",
    "HandEstimate",
    "ImpactModes",
    "MatchingPriors",
    "ModeCircles",
    "ModeMatch",
    "RatioReference",
    "best_matching",
    "channel_geometry",
    "choose_reference",
    "estimate_by_hand",
    "fit_mode_circles",
    "impact_modes",
    "match_by_ratios",
    "match_modes",
    "pair_probabilities",
    "pairing_odds",
    "rotate_to_real",
    "shapes_at_channels",
]
