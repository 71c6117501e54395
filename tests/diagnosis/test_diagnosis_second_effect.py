"""A second effect: both are found, and one that is not needed falls."""

import tomllib
from dataclasses import replace

import pytest

from diagnosis import diagnose, verdict_of
from diagnosis.effects import catalogue
from diagnosis.hypothesis_set import together
from diagnosis.refits.refitting import FIRST, LAST, LONG, begun_at, fitted, refit
from diagnosis.search.ladder import Search
from diagnosis.search.second_effect import by_itself, ordered, with_second
from tests.helpers.drawn import drawn


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    session, text = drawn(
        tmp_path_factory.mktemp("two"), 72_060, "gyroscopic", "structural_damping", ratio=6.0
    )
    return diagnose(session), tomllib.loads(text)


def test_two_effects_are_both_found_with_their_sizes(found):
    diagnosis, answer = found
    verdict = verdict_of(diagnosis)
    assert verdict.verdict == "several"
    truth = {(one["effect"], one["location"]): one for one in answer["cause"]}
    rows = {(row.effect, row.location): row for row in verdict.causes[:2]}
    assert set(rows) == set(truth)
    for key, row in rows.items():
        for name, value in truth[key]["parameters"].items():
            assert row.parameters[name] == pytest.approx(value, rel=0.15)
        assert row.interval
        assert row.probability > 0.8
    assert verdict.gap.after.excess < 1.15
    assert verdict.gap.closed > 0.99


def test_what_both_explain_none_alone_does(found):
    diagnosis, _ = found
    evidence = diagnosis.evidence
    best = min(one.chi_square for one in evidence.refits)
    assert evidence.pairs[0].chi_square - 1 < 0.1 * (best - 1)


def test_a_wrong_first_gives_way_to_what_explains_most_beside_the_second(found):
    diagnosis, answer = found
    scene, truth = diagnosis.base, {(one["effect"], one["location"]) for one in answer["cause"]}
    proposed = [one for effect in catalogue().values() for one in effect(scene)]
    places = {place.split(":")[1] for _, place in truth}
    wrong = next(
        one
        for one in proposed
        if one.effect == "mass_error" and one.location.split(":")[1] not in places
    )
    first = refit(scene, wrong, diagnosis.session.campaign, (*FIRST, *LAST))
    poor = replace(diagnosis.nothing, chi_square=1e6)  # beside which the first is worth it
    said: list[str] = []
    again = with_second(scene, poor, Search(refits=(first,)), proposed, said.append)
    assert "another in the place of the first" in said
    best = again.pairs[0]
    assert {one.key[:2] for one in best.hypothesis.members} == truth
    assert best.chi_square < 1.1
    assert min(both.chi_square for both in again.pairs if wrong in both.hypothesis.members) > 1.5


def test_a_single_effect_needs_no_second(tmp_path):
    session, text = drawn(tmp_path, 72_061, "structural_damping", ratio=6.0)
    verdict = verdict_of(diagnose(session))
    answer = tomllib.loads(text)
    assert verdict.verdict == "explained"
    first = verdict.causes[0]
    assert (first.effect, first.location) == (answer["effect"], answer["location"])
    assert verdict.probability.several < 0.1


def test_a_second_whose_shape_nobody_proposed_without_the_first_is_tried_as_it_is(found):
    diagnosis, _ = found
    second = next(one for one in diagnosis.search.refits if one.hypothesis.parts)
    task = by_itself(diagnosis.base, second, [])
    assert task.hypothesis is second.hypothesis
    assert len(task.start) == len(task.session.model.parameters)
    other = replace(second.hypothesis)
    assert by_itself(diagnosis.base, second, [other]).hypothesis is other
    # A sign and a gain are one number, and two hypotheses.
    another = replace(other, effect="another")
    assert by_itself(diagnosis.base, second, [another, other]).hypothesis is other


def test_each_of_two_is_fitted_alone_from_where_both_ended_too(found):
    diagnosis, _ = found
    both = diagnosis.search.pairs[0]
    alone = {one.key: one for one in diagnosis.search.refits}
    for member in both.hypothesis.members:
        single = alone[member.key]
        task = begun_at(by_itself(diagnosis.base, single, []), both)
        (again,) = fitted(diagnosis.base, [replace(task, stages=LONG)])
        assert single.cost <= again.cost * (1 + 1e-3)


def test_of_the_best_pair_it_is_known_what_it_leaves_without_bounds_of_tolerances(found):
    diagnosis, _ = found
    both = diagnosis.search.pairs[0]
    much = replace(both, chi_square=2.0, loose=None, pull=None)
    worse = replace(much, fit=replace(much.fit, cost=much.fit.cost + 1.0))
    first, second = worse.hypothesis.members
    elsewhere = replace(first, location="joint:elsewhere")
    worse = replace(worse, hypothesis=together((elsewhere, second)))
    turned = replace(worse, hypothesis=together((second, first)))  # the same two: once
    best, other = ordered(diagnosis.base, [worse, turned, much])
    assert best.fit is not worse.fit
    assert best.hypothesis is both.hypothesis
    assert best.loose <= both.chi_square * (1 + 1e-3)
    assert best.pull > 0
    assert other is worse
    little = replace(both, loose=None, chi_square=1.01, serial=0.01)
    assert ordered(diagnosis.base, [little])[0] is little
