"""A virtual hammer test of a virtual machine that knows the answers.

An independent twin: its equations of motion are its own, and files are its only contact with the
rest of the project. It imports no other package of it. Of MuJoCo it uses the reading of MJCF and
the forces at rest; nothing is simulated.
"""

from truth.campaign.case_design import Card, DrawnCase, deal_cards, draw_case, fit_to_machine
from truth.campaign.cause import Cause, Wanted
from truth.campaign.draw import Tolerances
from truth.campaign.folder import write_answer, write_campaign
from truth.campaign.further_tests import find_further_test, list_further_tests
from truth.campaign.measured import StatedTest, locate_tests
from truth.campaign.place_names import WHOLE_DECK, Choice, OwnTest, check_choice, find_place
from truth.campaign.protocol import Protocol, draw_protocol
from truth.campaign.usual_size import compare_with_usual
from truth.campaign.virtual_test import Plan, VirtualCampaign, draw_campaign
from truth.campaign.visits import draw_visits
from truth.errors import TruthError
from truth.machine.mujoco_reader import read_station, why_as_drawn
from truth.machine.springs import ClosedLoop
from truth.machine.station import Station

__all__ = [
    "WHOLE_DECK",
    "Card",
    "Cause",
    "Choice",
    "ClosedLoop",
    "DrawnCase",
    "OwnTest",
    "Plan",
    "Protocol",
    "StatedTest",
    "Station",
    "Tolerances",
    "TruthError",
    "VirtualCampaign",
    "Wanted",
    "check_choice",
    "compare_with_usual",
    "deal_cards",
    "draw_campaign",
    "draw_case",
    "draw_protocol",
    "draw_visits",
    "find_further_test",
    "find_place",
    "fit_to_machine",
    "list_further_tests",
    "locate_tests",
    "read_station",
    "why_as_drawn",
    "write_answer",
    "write_campaign",
]
