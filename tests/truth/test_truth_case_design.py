"""The deck of a blind test: every cause equally often, machines that know nothing of it."""

import tomllib
from collections import Counter
from dataclasses import replace
from itertools import islice

import pytest

from truth.campaign.case_design import _NOT_IN_DECK, RATIOS, Card, deal_cards, draw_case
from truth.campaign.virtual_test import draw_campaign
from truth.effects import CATALOGUE
from truth.effects.outside import OUTSIDE
from truth.errors import TruthError

DECK = [name for name in CATALOGUE if name not in _NOT_IN_DECK]


def round_of(seed, turn=0):
    """The cards of one round; it ends where all of the catalogue came once."""
    size = 4 + 2 + 2 + 1 + 2 + len(DECK) + len(OUTSIDE)
    return list(islice(deal_cards(seed), turn * size, (turn + 1) * size))


def test_a_round_holds_every_effect_once_and_all_kinds():
    found = round_of(3)
    kinds = Counter(card.kind for card in found)
    assert kinds == {
        "nothing": 4,
        "mistuned": 2,
        "two": 2,
        "many": 1,
        "twin": 2,
        "one": len(DECK),
        "outside": len(OUTSIDE),
    }
    assert Counter(card.names[0] for card in found if card.kind == "one") == Counter(DECK)
    (many,) = (card for card in found if card.kind == "many")
    assert 4 <= len(set(many.names)) <= 7


def test_four_rounds_give_every_effect_every_ratio():
    found = [card for turn in range(4) for card in round_of(5, turn)]
    for name in (*CATALOGUE, *OUTSIDE):
        ratios = {card.ratio for card in found if card.names == (name,) and card.kind != "twin"}
        assert ratios == (set() if name in _NOT_IN_DECK else set(RATIOS)), name


def test_the_order_is_shuffled_and_belongs_to_the_seed():
    assert round_of(1) == round_of(1)
    assert round_of(1) != round_of(2)
    assert [card.kind for card in round_of(1)] != sorted(card.kind for card in round_of(1))


def test_twins_share_machine_place_and_ratio(two_bodies, monkeypatch):
    pair = [
        Card("twin", ("structural_damping",), 2.0, 1, "joint"),
        Card("twin", ("viscoelastic",), 2.0, 1, "joint"),
        Card("one", ("viscoelastic",), 2.0),
    ]
    monkeypatch.setattr("truth.campaign.case_design.deal_cards", lambda *_: iter(pair))
    first, second, alone = (draw_case(two_bodies, 4, number) for number in range(3))
    assert first.campaign.files["model.xml"] == second.campaign.files["model.xml"]
    assert first.campaign.files["model.xml"] != alone.campaign.files["model.xml"]
    answers = [tomllib.loads(one.campaign.answer.decode()) for one in (first, second)]
    assert [one["effect"] for one in answers] == ["structural_damping", "viscoelastic"]
    assert answers[0]["location"] == answers[1]["location"]
    assert answers[0]["drawn"]["kind"] == "twin"


def test_an_effect_without_a_place_gives_way_to_another_in_the_same_machine(
    two_bodies, monkeypatch
):
    # Two bodies: no pair that no joint joins.
    monkeypatch.setattr(
        "truth.campaign.case_design.deal_cards",
        lambda *_: iter([Card("one", ("parallel_path",), 2)]),
    )
    case = draw_case(two_bodies, 4, 0)
    answer = tomllib.loads(case.campaign.answer.decode())
    assert answer["effect"] != "parallel_path"
    monkeypatch.setattr("truth.campaign.case_design.deal_cards", lambda *_: iter([Card("nothing")]))
    assert (
        draw_case(two_bodies, 4, 0).campaign.files["model.xml"]
        == (case.campaign.files["model.xml"])
    )


def test_a_case_is_the_same_whenever_it_is_drawn(two_bodies):
    one, again = (draw_case(two_bodies, 9, 0).campaign for _ in range(2))
    assert one.files == again.files
    assert one.answer == again.answer


def test_several_effects_have_their_tables(two_bodies, monkeypatch, silence):
    silence(monkeypatch)
    card = Card("two", ("mass_error", "sensor_gain"), 2.0)
    monkeypatch.setattr("truth.campaign.case_design.deal_cards", lambda *_: iter([card]))
    answer = tomllib.loads(draw_case(two_bodies, 1, 0).campaign.answer.decode())
    assert answer["effect"] == "several"
    assert [one["effect"] for one in answer["cause"]] == ["mass_error", "sensor_gain"]
    assert all(one["parameters"] for one in answer["cause"])


def test_a_machine_without_sensors_is_refused(two_bodies):
    bare = replace(
        two_bodies, stages=tuple(replace(stage, sensors=()) for stage in two_bodies.stages)
    )
    with pytest.raises(TruthError, match="nothing"):
        draw_campaign(bare, draw_case(two_bodies, 1, 0).plan)


def test_small_effects_behind_a_large_one_have_a_size():
    many = [card for seed in range(20) for card in round_of(seed) if card.kind == "many"]
    assert len(many) == 20
    assert not {name for card in many for name in card.names} & {"sensor_polarity", "sensor_swap"}


@pytest.mark.parametrize("pair", [("joint_coupling", "support_loss"), ("mass_error", "appendage")])
def test_a_place_is_drawn_that_does_for_both_twins(pair, monkeypatch, silence):
    # Random trees have stages without all six directions: no place for a support that is lost.
    silence(monkeypatch)  # places are asked for, not sizes
    kind = "body" if pair[0] == "mass_error" else "joint"
    deck = [Card("twin", (name,), 1.0, number, kind, pair) for number in range(4) for name in pair]
    monkeypatch.setattr("truth.campaign.case_design.deal_cards", lambda *_: iter(deck))
    for number in range(0, len(deck), 2):
        answers = [
            tomllib.loads(draw_case(None, 3, one).campaign.answer.decode())
            for one in (number, number + 1)
        ]
        assert tuple(one["effect"] for one in answers) == pair
        assert answers[0]["location"] == answers[1]["location"]


def test_no_file_of_a_random_machine_tells_a_seed():
    case = draw_case(None, 4321, 0)
    assert case.plan.seed > 2**64
    for name, content in case.campaign.files.items():
        for seed in (case.plan.seed, 4321):
            assert str(seed).encode() not in name.encode() + content, name
    stages = len(case.station.stages)
    assert f'model="tree{stages}"'.encode() in case.campaign.files["model.xml"]
