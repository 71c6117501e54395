"""The scorecard in small: a random tree of three stages, real instruments, 5 % dirt.

One campaign has a spinning rotor beside the dirt, the other has the dirt alone.
"""

from dataclasses import asdict

import pytest

from tests.bench.scorecard import diagnosed
from tests.bench.scorecard_draws import Design, Stored
from tests.bench.scorecard_rates import graded
from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.campaign.draw import REAL_INSTRUMENTS
from truth.grade.beside_background import right_first
from truth.machine.random_tree import draw_tree

SEED, DIRT = 410_002, 5.0


def row_of(folder, *effects):
    """Row of the bench for a campaign that is drawn here."""
    tree = draw_tree(SEED, 3)
    wanted = tuple(Wanted(effect, None, 6.0, corrections=3) for effect in effects)
    protocol = Protocol((tree.first_aim(),), lines=121, resolution_hz=4 / 3)
    plan = Plan(SEED, Cause(wanted), protocol, REAL_INSTRUMENTS, dirt=DIRT)
    campaign = draw_campaign(tree, plan)
    write_campaign(campaign, folder, sealed=True)
    stored = Stored(folder, campaign.answer.decode(), SEED, 0.0)
    design = Design("dirt 5 %" if effects else "dirt alone", effects, 6.0, DIRT)
    return {"seed": SEED, **asdict(design), **diagnosed(stored)}


@pytest.fixture(scope="module")
def rotor(tmp_path_factory):
    return graded(row_of(tmp_path_factory.mktemp("rotor") / "campaign", "gyroscopic"))


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    return graded(row_of(tmp_path_factory.mktemp("alone") / "campaign"))


def test_the_rotor_is_first_beside_the_dirt(rotor):
    assert rotor.cell == "dirt 5 %, ratio 4"
    assert rotor.truth.causes[0].location == "body:stage3"
    assert right_first(rotor.truth, rotor.verdict)
    assert 0 < rotor.row["seconds"] < 150


def test_the_rotor_is_the_only_cause_and_a_rest_remains(rotor):
    assert rotor.verdict.verdict in ("partly", "explained")
    assert not rotor.wrong_causes


def test_the_dirt_leaves_a_gap(alone):
    assert alone.verdict.verdict in ("unexplained", "partly", "explained", "several")
    assert alone.verdict.retuned > 2
    assert len(alone.truth.background) > 10


def test_dirt_alone_is_no_wrong_cause(alone):
    assert not alone.wrong_causes
