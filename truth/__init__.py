"""A virtual hammer test of a virtual machine that knows the answers.

An independent twin: its equations of motion are its own, and files are its only contact with the
rest of the project. It imports no other package of it, and no simulator.
"""

from truth.campaign.case_design import Card, deal_cards, draw_case
from truth.campaign.cause import Cause, Wanted
from truth.campaign.folder import write_answer, write_campaign
from truth.campaign.protocol import Protocol, draw_protocol
from truth.campaign.virtual_test import Campaign, Plan, draw_campaign
from truth.errors import TruthError
from truth.machine.mjcf_reader import read_station

__all__ = [
    "Campaign",
    "Card",
    "Cause",
    "Plan",
    "Protocol",
    "TruthError",
    "Wanted",
    "deal_cards",
    "draw_campaign",
    "draw_case",
    "draw_protocol",
    "read_station",
    "write_answer",
    "write_campaign",
]
