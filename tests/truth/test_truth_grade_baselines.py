"""What the files tell without a diagnosis, and what pure chance would score."""

from itertools import permutations

import numpy as np
import pytest

from truth.errors import TruthError
from truth.grade.answer import TrueCause, Truth
from truth.grade.baselines import (
    RANKINGS,
    by_comac,
    by_frac,
    by_residual,
    gain_verdict,
    hypotheses_of,
    mass_verdict,
    refit_only,
)
from truth.grade.compare import Agreement, DrawingComparison
from truth.grade.marks import MEANS, RATES, Excess, marks_of
from truth.grade.report import among_three, chance_marks
from truth.grade.verdict import CATALOGUE, Row, StatedVerdict, canonical, check_place

CHANNELS = (
    Agreement(1, 1, frac=0.9, residual=0.5),
    Agreement(2, 2, frac=0.2, residual=0.7),
    Agreement(3, 3, frac=0.5, residual=0.9),
    Agreement(2, 1, frac=0.1, residual=0.1),
)
COMAC = {(1, 1): 0.3, (2, 2): 0.9, (3, 3): 0.5}


@pytest.fixture
def comparison(two_bodies):
    return DrawingComparison(two_bodies, (1, 3), CHANNELS, COMAC)


def test_outputs_are_ranked_by_what_agrees_worst(comparison):
    assert by_frac(comparison) == [(2, 1), (2, 2), (3, 3), (1, 1)]
    assert by_residual(comparison) == [(3, 3), (2, 2), (1, 1), (2, 1)]
    assert by_comac(comparison) == [(1, 1), (3, 3), (2, 2)]
    assert set(RANKINGS) == {"frac", "residual", "comac"}


def test_a_rank_blames_sensors_by_their_worst_direction(comparison):
    verdict = gain_verdict(comparison, by_frac)
    assert [(row.effect, row.location, row.dof) for row in verdict.causes] == [
        ("sensor_gain", "sensor:acc2", "tx"),
        ("sensor_gain", "sensor:acc3", "tz"),
        ("sensor_gain", "sensor:acc1", "tx"),
    ]
    assert [row.probability for row in verdict.causes] == [1, 0, 0]
    assert [place for place, _ in verdict.where] == ["sensor:acc2", "sensor:acc3", "sensor:acc1"]


def test_a_rank_blames_the_bodies_that_carry_the_sensors(comparison):
    # Nodes 1 and 3 are on the table, node 2 on the holder.
    assert [row.location for row in mass_verdict(comparison, by_residual).causes] == [
        "body:table",
        "body:holder",
    ]
    assert mass_verdict(comparison, by_frac).causes[0].location == "body:holder"


def test_a_baseline_goes_through_the_marks_of_all(comparison):
    truth = Truth((TrueCause("sensor_gain", "sensor:acc3", dof="tz"),))
    marks = marks_of(truth, gain_verdict(comparison, by_residual))
    assert (marks["both"], marks["direction"], marks["probability_of_truth"]) == (1, 1, 1)
    marks = marks_of(truth, gain_verdict(comparison, by_frac))
    assert (marks["effect_first"], marks["both"], marks["top3"], marks["brier"]) == (1, 0, 1, 2)


@pytest.mark.parametrize(("excess", "word"), [(1.09, "none"), (1.1, "unexplained")])
def test_a_refit_alone_tells_whether_there_is_a_gap(excess, word):
    verdict = refit_only(Excess(refit=excess))
    assert verdict.verdict == word
    assert (verdict.none, verdict.unexplained) == ((1, 0) if word == "none" else (0, 1))


def test_without_a_refit_there_is_no_such_baseline():
    with pytest.raises(TruthError, match=r"no refit\.json"):
        refit_only(Excess(oracle=1.0))


def test_the_places_of_a_machine_are_those_of_the_catalogue(comparison):
    found = hypotheses_of(comparison)
    for effect, places in found.items():
        assert all(check_place(effect, place) for place in places)
    assert found["appendage"] == ("body:table", "body:holder")
    assert found["hammer_misalignment"] == ("hammer:acc1", "hammer:acc3")
    assert found["sensor_swap"][3:] == (
        "sensor:acc1+acc2",
        "sensor:acc1+acc3",
        "sensor:acc2+acc3",
    )
    # Two bodies that a joint joins, each with all six directions: no bypass, no rigid direction.
    # No test has a state before a change.
    absent = {"parallel_path", "missing_dof", "stiffness", "damping"}
    assert set(CATALOGUE) - set(found) == absent


def test_bodies_that_no_joint_joins_are_pairs(nominal):
    found = hypotheses_of(DrawingComparison(nominal, (11,), CHANNELS, COMAC))
    assert len(found["parallel_path"]) == 10  # of 15 pairs in a stack of six
    assert "pair:granite_bottom-granite_top" not in found["parallel_path"]
    assert len(found["sensor_swap"]) == 23 + 253


HYPOTHESES = {
    "appendage": ("body:a", "body:b", "body:c"),
    "mass_error": ("body:a", "body:b"),
    "parallel_path": ("pair:c-a",),
    "drift": ("joint:a", "joint:b"),
}
TRUTHS = [
    Truth(),
    Truth((TrueCause("appendage", "body:b", dof="tz"),)),
    Truth((TrueCause("parallel_path", canonical("pair:c-a")),)),
    Truth((TrueCause("gyroscopic", "body:a"),)),
    Truth((TrueCause("unexplained", "joint:b"),)),
    Truth((TrueCause("unexplained", "joint:elsewhere"),)),
    Truth((TrueCause("drift", "joint:b"), TrueCause("appendage", "body:a"))),
]


def drawn_one_by_one(chances):
    """Every order of three, and the chance of drawing it, none twice."""
    for order in permutations(range(len(chances)), 3):
        left, chance = 1.0, 1.0
        for one in order:
            chance *= chances[one] / left
            left -= chances[one]
        yield order, chance


@pytest.mark.parametrize("truth", TRUTHS)
def test_chance_scores_as_the_mean_over_all_that_may_be_drawn(truth):
    labels = [(effect, canonical(place)) for effect in HYPOTHESES for place in HYPOTHESES[effect]]
    chances = [1 / (4 * len(HYPOTHESES[effect])) for effect, _ in labels]
    expected = dict.fromkeys(RATES, 0.0)
    for order, chance in drawn_one_by_one(chances):
        rows = tuple(
            Row(*labels[which], probability)
            for which, probability in zip(order, (1, 0, 0), strict=True)
        )
        marks = marks_of(truth, StatedVerdict("explained", causes=rows))
        for name in RATES:
            mark = marks[name]
            if mark is None or expected[name] is None:
                expected[name] = None
            else:
                expected[name] += chance * mark
    found = chance_marks(truth, HYPOTHESES)
    skipped = {"where_first", "where_top3", "direction"}  # drawn apart, below; not stated
    for name in RATES.keys() - skipped:
        assert found[name] == (None if expected[name] is None else pytest.approx(expected[name]))


@pytest.mark.parametrize("truth", [one for one in TRUTHS if one.places])
def test_chance_sees_places_as_its_effects_sit_there(truth):
    by_place = {}
    for places in HYPOTHESES.values():
        for place in places:
            by_place[canonical(place)] = by_place.get(canonical(place), 0) + 1 / (4 * len(places))
    labels = list(by_place)
    first = top = 0.0
    for order, chance in drawn_one_by_one(list(by_place.values())):
        seen = [labels[one] in truth.places for one in order]
        first += chance * seen[0]
        top += chance * any(seen)
    found = chance_marks(truth, HYPOTHESES)
    assert found["where_first"] == pytest.approx(first)
    assert found["where_top3"] == pytest.approx(top)


@pytest.mark.parametrize("truth", TRUTHS)
def test_chance_states_the_probabilities_that_it_draws_from(truth):
    rows = tuple(
        Row(effect, canonical(place), 1 / (4 * len(places)))
        for effect, places in HYPOTHESES.items()
        for place in places
    )
    honest = marks_of(truth, StatedVerdict("explained", causes=rows))
    found = chance_marks(truth, HYPOTHESES)
    for name in ("probability_of_truth", "brier", "log_score"):
        assert found[name] == pytest.approx(honest[name])


def test_chance_closes_nothing_of_a_gap_and_names_no_twins():
    assert chance_marks(TRUTHS[1], HYPOTHESES)["twin_set"] == 1
    assert chance_marks(TRUTHS[1], HYPOTHESES, Excess(5.0, 1.0))["shrink_share"] == 0
    assert chance_marks(TRUTHS[1], HYPOTHESES)["shrink_share"] is None
    assert set(chance_marks(TRUTHS[1], HYPOTHESES)) == set(RATES) | set(MEANS)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_of_three_or_fewer_all_are_among_three(count):
    assert among_three(np.full(count, 1 / count), [0]) == pytest.approx(1)


def test_of_equal_chances_three_in_n_are_drawn():
    assert among_three(np.full(12, 1 / 12), [4]) == pytest.approx(3 / 12)
    assert among_three(np.full(12, 1 / 12), [4, 7]) == pytest.approx(
        1 - 9 * 10 / (11 * 12) * 8 / 10
    )
