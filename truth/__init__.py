"""A virtual hammer test of a virtual machine that knows the answers.

An independent twin: its equations of motion are its own, and files are its only contact with the
rest of the project. It imports no other package of it. Of MuJoCo it uses the reading of MJCF and
the forces at rest; nothing is simulated.
"""

from truth.campaign.case_design import Card, DrawnCase, deal_cards, draw_case
from truth.campaign.cause import Cause, Wanted
from truth.campaign.choice import WHOLE_DECK, Choice, OwnTest
from truth.campaign.draw import Tolerances
from truth.campaign.fitting_band import fit_to_machine
from truth.campaign.folder import write_answer, write_campaign
from truth.campaign.further_tests import (
    FurtherGain,
    compare_sizes,
    find_further_test,
    list_further_tests,
    rank_gains,
)
from truth.campaign.linearised_test import linearise_test
from truth.campaign.measured import StatedTest, locate_tests
from truth.campaign.place_names import check_choice, find_place
from truth.campaign.protocol import Protocol, draw_protocol
from truth.campaign.signatures import find_signatures
from truth.campaign.smallest_sizes import SmallestSize, named_size, predict_smallest
from truth.campaign.tolerance_shift import list_without_tolerance
from truth.campaign.virtual_test import Plan, VirtualCampaign, draw_campaign
from truth.campaign.weighing import Weighing
from truth.errors import TruthError
from truth.machine.reading import read_station, why_as_drawn
from truth.machine.station import Station

__all__ = [
    "WHOLE_DECK",
    "Card",
    "Cause",
    "Choice",
    "DrawnCase",
    "FurtherGain",
    "OwnTest",
    "Plan",
    "Protocol",
    "SmallestSize",
    "StatedTest",
    "Station",
    "Tolerances",
    "TruthError",
    "VirtualCampaign",
    "Wanted",
    "Weighing",
    "check_choice",
    "compare_sizes",
    "deal_cards",
    "draw_campaign",
    "draw_case",
    "draw_protocol",
    "find_further_test",
    "find_place",
    "find_signatures",
    "fit_to_machine",
    "linearise_test",
    "list_further_tests",
    "list_without_tolerance",
    "locate_tests",
    "named_size",
    "predict_smallest",
    "rank_gains",
    "read_station",
    "why_as_drawn",
    "write_answer",
    "write_campaign",
]
