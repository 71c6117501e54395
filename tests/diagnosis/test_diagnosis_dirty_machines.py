"""The bench of real machines in small: a random tree of three stages, real instruments, 5 % dirt.

One campaign has a spinning rotor beside the dirt, the other has the dirt alone. What the engine of
today gives is asserted. One test is marked as an expected failure: it states what the model-error
floor has to bring, that the verdict is ``partly`` or ``explained`` and names the rotor alone. When
it does, the strict mark fails: remove it, and assert that ``rest`` states what remains.
"""

import pytest

from tests.bench.dirty import diagnosed, dirt_items, weakest_ratio
from tests.bench.dirty_campaigns import Stored
from tests.bench.dirty_rates import graded, has_wrong_cause
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
    answer = campaign.answer.decode()
    stored = Stored(folder, answer, SEED, 0.0)
    told = {"cell": "single" if effects else "alone", "effects": effects, "dirt": DIRT}
    told |= {"drawn_ratio": weakest_ratio(answer), "items": dirt_items(answer)}
    return told | {"seed": SEED, "answer": answer.partition("\n[dirt]")[0]} | diagnosed(stored)


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
    assert not has_wrong_cause(rotor)


def test_the_dirt_leaves_a_gap(alone):
    assert alone.verdict.verdict in ("unexplained", "partly", "explained", "several")
    assert alone.verdict.retuned > 2
    assert len(alone.truth.background) > 10


def test_dirt_alone_is_no_wrong_cause(alone):
    assert not has_wrong_cause(alone)
