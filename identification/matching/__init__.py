"""Measured modes matched with simulated ones: as printed, and with all that is known."""

from identification.matching.assignment import best_matching, pair_probabilities
from identification.matching.hand_methods import ByHand, by_hand
from identification.matching.likelihood import Beliefs, odds
from identification.matching.measured_modes import ImpactModes, impact_modes, in_phase
from identification.matching.mode_matching import Match, at_channels, channels_at, match
from identification.matching.ratio_method import PrintedMatch, Reading, printed_match, steadiest

__all__ = [
    "Beliefs",
    "ByHand",
    "ImpactModes",
    "Match",
    "PrintedMatch",
    "Reading",
    "at_channels",
    "best_matching",
    "by_hand",
    "channels_at",
    "impact_modes",
    "in_phase",
    "match",
    "odds",
    "pair_probabilities",
    "printed_match",
    "steadiest",
]
