"""The scorecard in small: random trees of three stages with small errors everywhere.

One has a strong appendage beside the dirt and is read by real instruments, the other has the dirt
alone.
"""

from dataclasses import asdict

import pytest

from tests.bench.beside_background import right_first
from tests.bench.scorecard import diagnosed
from tests.bench.scorecard_draws import Design, Stored
from tests.bench.scorecard_rates import graded
from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.campaign.draw import REAL_INSTRUMENTS, Tolerances
from truth.machine.random_tree import draw_tree


def grade_drawn(folder, seed, design, tolerances):
    """Row of the bench for a campaign that is drawn here, graded."""
    tree = draw_tree(seed, 3)
    wanted = tuple(Wanted(effect, None, design.ratio) for effect in design.effects)
    protocol = Protocol((tree.first_aim(),), lines=161, resolution_hz=1.0)
    plan = Plan(seed, Cause(wanted), protocol, tolerances, dirt=design.dirt)
    campaign = draw_campaign(tree, plan)
    write_campaign(campaign, folder, sealed=True)
    stored = Stored(folder, campaign.answer.decode(), seed, 0.0)
    return graded({"seed": seed, **asdict(design), **diagnosed(stored)})


@pytest.fixture(scope="module")
def appendage(tmp_path_factory):
    folder = tmp_path_factory.mktemp("appendage") / "campaign"
    design = Design("dirt 5 %", ("appendage",), 8.0, 5.0)
    return grade_drawn(folder, 72_510, design, REAL_INSTRUMENTS)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone") / "campaign"
    return grade_drawn(folder, 72_502, Design("dirt alone", dirt=10.0), Tolerances())


def test_the_appendage_is_first_beside_the_dirt(appendage):
    assert appendage.cell == "dirt 5 %, ratio 4"
    assert right_first(appendage.truth, appendage.verdict)
    assert appendage.verdict.causes[0].probability > 0.9
    assert 0 < appendage.row["seconds"] < 150


def test_the_appendage_is_the_only_cause_and_the_rest_is_everywhere(appendage):
    assert appendage.verdict.verdict == "partly"
    assert not appendage.wrong_causes
    rest = appendage.row["verdict"]["rest"]
    assert rest["significant"]
    assert rest["spread"] == "everywhere"


def test_the_dirt_leaves_a_gap_that_is_unexplained(alone):
    assert alone.verdict.verdict == "unexplained"
    assert alone.verdict.retuned > 2
    assert len(alone.truth.background) > 10
    rest = alone.row["verdict"]["rest"]
    assert rest["significant"]
    assert rest["model_error"] > 0.003


def test_dirt_alone_is_no_wrong_cause(alone):
    assert not alone.wrong_causes
    assert all(cause.probability < 0.5 for cause in alone.verdict.causes)
