"""Stepwise selection: causes are found together, proxies dropped, and model error is the rest."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import EFFECTS, Hypothesis, build_verdict, diagnose
from diagnosis.data_checks.candidates import build_candidates
from diagnosis.data_checks.sensors import check_sensors
from diagnosis.decision import held_out_check
from diagnosis.decision.closed_by_proven import divide_closed_gap
from diagnosis.decision.established import _find_closed_by_causes, describe_present
from diagnosis.decision.held_out_check import (
    admit_predictive_causes,
    predicts_held_out,
)
from diagnosis.inference.evidence import ForceGain
from diagnosis.search.elimination import reconsider_causes
from diagnosis.search.fitted_sets import Search
from diagnosis.search.local_gap import acts_along, acts_at, find_local_force, list_further_peaks
from diagnosis.search.refit_round import _select_promising
from diagnosis.search.score_test import Score, list_peaks
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, propose_at, refit_null, refit_with
from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.machine.random_tree import draw_tree
from tuning import is_gap_visible, open_session


@pytest.fixture(scope="module")
def two_effects(tmp_path_factory):
    """A machine with a drift and a displaced centre of stiffness, diagnosed."""
    folder = tmp_path_factory.mktemp("two")
    session, answer = drawn(folder, 72_520, "drift", "joint_coupling", ratio=6.0, lines=161)
    return diagnose(session), tomllib.loads(answer)


def test_two_effects_at_once_are_found_with_their_places(two_effects):
    found, answer = two_effects
    verdict = build_verdict(found)
    assert verdict.verdict == "several"
    expected = {(cause["effect"], cause["location"]) for cause in answer["cause"]}
    named = {(c.effect, c.location) for c in verdict.causes if c.probability > 0.9}
    assert named == expected
    assert verdict.gap.closed > 0.9


def test_a_set_with_the_causes_has_a_lower_floor_than_the_null_model(two_effects):
    found, _ = two_effects
    assert found.search.selected.floor < 0.2 * found.null.floor
    assert found.search.selected.objective < found.null.objective


def test_causes_that_predict_held_out_lines_no_better_are_not_admitted(two_effects, monkeypatch):
    found, _ = two_effects
    gaps = found.gaps
    price = found.evidence.price_causes(found.search.selected.keys)
    assert price == pytest.approx(2 * np.log(found.evidence.hypotheses))
    assert predicts_held_out(gaps.retuned, gaps.after, price)
    useless = replace(gaps.after, predicted=gaps.retuned.predicted)
    assert not predicts_held_out(gaps.retuned, useless, price)
    assert predicts_held_out(gaps.after, gaps.after, price)  # not visible: the fits decide

    # A block of lines that the fits predict badly does not decide: its floor is its own. What
    # closes less than nothing of the gap is none.
    begin, end = gaps.after.starts[1:3]

    def miss_block(factor):
        missed = [values.copy() for values in gaps.after.predicted]
        for values in missed:
            values[begin:end] *= factor
        return replace(gaps.after, predicted=tuple(missed))

    beside = miss_block(1.03)
    assert gaps.after.gap.excess < beside.gap.excess < gaps.retuned.gap.excess
    assert predicts_held_out(gaps.retuned, beside, price)
    assert miss_block(30.0).gap.excess > gaps.retuned.gap.excess
    assert not predicts_held_out(gaps.retuned, miss_block(30.0), price)

    def estimate(base, whole, null, chosen, settings):
        return replace(gaps, after=useless if chosen.causes else None)

    monkeypatch.setattr(held_out_check, "estimate_gaps", estimate)
    base = SimpleNamespace(proven=(), scene=replace(found.scene, session=found.session))
    arguments = base, found.session, found.search, found.evidence, SETTINGS
    evidence, posterior, left = admit_predictive_causes(*arguments)
    assert found.search.selected.keys in evidence.rejected
    assert len(set(map(frozenset, evidence.rejected))) == len(evidence.rejected)  # none twice
    assert posterior.unexplained > 0.5
    assert all(share < 0.5 for _, share in posterior.sets)
    assert left.after is None


def test_a_proven_fault_that_closes_little_beside_a_larger_gap_is_a_remark(two_effects):
    found, _ = two_effects
    swap = ("sensor_swap", "sensor:acc1", "tx+ty")
    fault = SimpleNamespace(effect=swap[0], location=swap[1], dof=swap[2])
    base = SimpleNamespace(proven=(), checks=SimpleNamespace(faults=(fault,)), scene=found.scene)
    arguments = found.search, found.evidence, found.posterior, found.gaps, SETTINGS
    present = describe_present(base, *arguments)
    assert [remark.key for remark in present.remarks] == [swap]
    assert swap not in present.established
    assert present.word == found.present.word


def test_a_cause_closes_a_part_of_the_gap_that_remains_without_it():
    def fit(gap, *names):
        keys = tuple(("mass_error", f"body:{name}", None) for name in names)
        return SimpleNamespace(keys=keys, gap=gap, objective=gap)

    null, strong, weak, both = fit(40.0), fit(6.0, "a"), fit(35.0, "b"), fit(0.5, "a", "b")
    search = Search(null, both, refits=(strong, weak, both))
    closed = _find_closed_by_causes(search, both)
    assert closed[both.keys[0]] == pytest.approx(34.5 / 35)
    assert closed[both.keys[1]] == pytest.approx(5.5 / 6)  # 14 % of the null model's gap
    # Of what is next to nothing no part counts, but that of the null model's gap.
    nearly, all_but_none = fit(0.1, "a"), fit(0.01, "a", "b")
    search = Search(null, nearly, refits=(nearly, all_but_none))
    assert _find_closed_by_causes(search, all_but_none)[both.keys[1]] < 1.0
    little = _find_closed_by_causes(Search(null, nearly, refits=(nearly,)), nearly)
    assert little == pytest.approx({nearly.keys[0]: 39.9 / 40})


def scored(effect, location, gain, order=0):
    """A score of a hypothesis."""
    return Score(Hypothesis(effect, location), gain, np.ones(1), order)


def test_where_a_free_force_explains_much_each_effect_is_refitted_whatever_its_score():
    def push(*shares):
        return [
            ForceGain(location=f"body:{name}", dof="tx", gain=1e3 * share, share=share)
            for name, share in zip("ab", shares, strict=True)
        ]

    least = SETTINGS.min_local_share
    assert find_local_force(push(least, 0.1), SETTINGS) == push(least, 0.1)[0]
    force = find_local_force(push(0.1, least + 0.1), SETTINGS)
    assert force.location == "body:b"
    assert find_local_force(push(0.9 * least, 0.1), SETTINGS) is None  # everywhere
    assert find_local_force([], SETTINGS) is None
    elsewhere = [scored("mass_error", f"body:{k}", 100.0 - k) for k in range(12)]
    there = [
        scored("appendage", "body:b", 3.0, 1),
        scored("appendage", "body:b", 2.0, 2),  # beside the best shape
        scored("appendage", "body:b", 1.5, 5),  # beyond a mode
        scored("appendage", "body:b", 0.0, 3),
        scored("appendage", "body:b", 0.1, 4),
        scored("mass_error", "body:b", 1.0),
        scored("parallel_path", "pair:world-b", 0.5),
        scored("parallel_path", "pair:a-b", 0.4),  # pushes a as well
        scored("gyroscopic", "body:b", 0.0),  # explains nothing
    ]
    ranked = [*elsewhere, *there]
    most = [score.hypothesis for score in elsewhere[: SETTINGS.max_refits]]
    assert _select_promising(ranked, None, SETTINGS) == most
    at_place = [there[k].hypothesis for k in (0, 5, 6)]
    assert _select_promising(ranked, force, SETTINGS) == [*most, *at_place]
    further = [there[2].hypothesis]
    assert list_further_peaks(ranked, "body:b", 2) == further
    assert list_further_peaks(ranked, "body:b", 0) == list_further_peaks(ranked, None, 2) == []
    assert acts_at(Hypothesis("joint_coupling", "joint:b"), "joint:b")
    assert not acts_at(Hypothesis("joint_coupling", "joint:b"), None)
    along = Hypothesis("mass_error", "body:b", "tx")
    assert acts_along(along, force)
    assert not any(acts_along(along, elsewhere) for elsewhere in (None, push(0.9, 0.1)[0]))
    assert not acts_along(Hypothesis("mass_error", "body:b", "ty"), force)


def test_peaks_of_a_scan_are_those_that_no_neighbour_exceeds():
    gains = [0.0, 2.0, 5.0, 5.0, 1.0, 0.0, 0.0, 7.0, 0.5, 3.0]
    rows = [scored("appendage", "body:b", gain, k) for k, gain in enumerate(gains)]
    ranked = sorted(rows, key=lambda score: -score.gain)
    assert [score.order for score in list_peaks(ranked)] == [7, 2, 9]
    assert list_peaks(rows[5:7]) == []
    assert list_peaks([]) == []


@pytest.fixture(scope="module")
def drift_and_proxy(tmp_path_factory):
    """A machine with a drift: scene, null model, the cause, a proxy, and the fit with that."""
    folder = tmp_path_factory.mktemp("drift")
    session, text = drawn(folder, 72_012, "drift", ratio=6.0, lines=161)
    answer = tomllib.loads(text)
    scene = early_scene(session)
    null = refit_null(scene)
    (cause,) = (
        one for one in propose_at(scene, "drift", answer["location"]) if one.dof == answer["dof"]
    )
    proxy = propose_at(scene, "structural_damping", answer["location"])[0]
    return scene, null, cause, proxy, refit_with(scene, null, proxy)


def test_elimination_drops_a_proxy_and_keeps_the_cause(drift_and_proxy):
    scene, null, cause, proxy, with_proxy = drift_and_proxy
    both = refit_with(scene, with_proxy, cause)
    scores = tuple(SimpleNamespace(hypothesis=one) for one in (proxy, cause))
    search = Search(null, null, scores=scores, refits=(with_proxy, both))
    base = SimpleNamespace(scene=scene, proven=())
    after, kept = reconsider_causes(base, search, both, SETTINGS)
    assert kept.keys == (cause.key,)
    assert [refit.keys for refit in after.refits[2:]] == [(cause.key,)]


def test_a_proxy_is_dropped_once_another_one_is_replaced_by_the_cause(drift_and_proxy):
    scene, null, cause, _, with_proxy = drift_and_proxy
    further = propose_at(scene, "joint_coupling", cause.location)[0]
    both = refit_with(scene, with_proxy, further)
    search = Search(null, null, scores=(), refits=(with_proxy, both))
    base = SimpleNamespace(scene=scene, proven=(), checks=SimpleNamespace(small=()))
    after, kept = reconsider_causes(base, search, both, SETTINGS)
    assert (further.key, cause.key) in [refit.keys for refit in after.refits]
    assert kept.keys == (cause.key,)


def test_a_cause_at_a_wrong_place_is_replaced_once_the_others_are_known(two_effects):
    found, answer = two_effects
    drift, coupling = ((cause["effect"], cause["location"]) for cause in answer["cause"])
    scene, null = found.scene, found.search.null
    wrong = next(
        hypothesis
        for hypothesis in EFFECTS[coupling[0]](scene)
        if hypothesis.location not in (coupling[1], drift[1])
    )
    (right,) = (cause for cause in found.search.selected.causes if cause.effect == drift[0])
    best = refit_with(scene, refit_with(scene, null, wrong), right)
    # Nothing is more probable than the selected set, so that nothing is dropped.
    search = Search(null, found.search.selected, scores=found.search.scores, refits=(best,))
    base = SimpleNamespace(scene=scene, proven=())
    _, kept = reconsider_causes(base, search, best, SETTINGS)
    assert {cause.site for cause in kept.causes} == {
        "@".join(drift),
        "@".join(coupling),
    }
    assert is_gap_visible(best.gap)
    assert not is_gap_visible(kept.gap)


def test_two_wrong_sensors_of_a_body_replace_its_bending(tmp_path):
    tree = draw_tree(72_602, 3)
    sites = (sensor.site for place, sensor in tree.sensors() if tree.stages[place].name == "stage2")
    places = map("sensor:{}".format, sites)
    answers = list(zip(("sensor_gain", "sensor_position"), places, strict=False))
    cause = Cause(tuple(Wanted(effect, place, 8.0) for effect, place in answers))
    protocol = Protocol(nodes=(tree.first_aim(),), lines=81, resolution_hz=2.0)
    write_campaign(draw_campaign(tree, Plan(72_602, cause, protocol=protocol)), tmp_path / "test")
    session = open_session(tmp_path / "test")
    scene, checks = early_scene(session), check_sensors(session.campaign, SETTINGS)
    base = SimpleNamespace(scene=scene, checks=checks, proven=())
    null = refit_null(scene)
    candidates = {cause.effect: cause for cause in build_candidates(checks, session, SETTINGS)}
    bending = refit_with(scene, null, candidates["flexible_body"])
    best = refit_with(scene, bending, candidates["sensor_position"])
    scores = tuple(SimpleNamespace(hypothesis=cause) for cause in candidates.values())
    small_faults = tuple(cause.key for cause in candidates.values())
    search = Search(null, best, scores, (bending, best), small_faults)
    _, kept = reconsider_causes(base, search, best, SETTINGS)
    assert {tuple(cause.site.split("@")) for cause in kept.causes} == set(answers)


def test_a_single_cause_is_not_eliminated(tmp_path):
    session, _ = drawn(tmp_path, 72_012, lines=81)
    hypothesis = Hypothesis("drift", "joint:a")
    refit = SimpleNamespace(causes=(hypothesis,))
    base = SimpleNamespace(scene=early_scene(session), proven=())
    search = Search(refit, refit)
    after, kept = reconsider_causes(base, search, refit, SETTINGS)
    assert kept is refit
    assert after.refits == ()


def test_on_a_machine_that_lacks_nothing_no_set_is_selected(tmp_path):
    session, _ = drawn(tmp_path, 72_010, lines=161)
    found = diagnose(session, settings=replace(SETTINGS, max_refits=4))
    assert found.present.word == "none"
    assert found.search.selected.causes == ()
    assert found.present.causes == ()


def test_a_fault_that_misleads_the_null_model_closes_its_gap():
    # Retuned to a wrong sign, the null model is farther off than the wrong sign alone.
    key = ("sensor_polarity", "sensor:acc1", "tz")
    (closed,) = divide_closed_gap({key: 3.0}, 1.5, 50.0, 48.5).values()
    assert closed == pytest.approx(0.97)
    # Two faults share what correcting both closes; without it each counts as the last one.
    second = ("sensor_gain", "sensor:acc2", "tx")
    both = {key: 3.0, second: 2.0}
    assert divide_closed_gap(both, 1.5, 50.0, 40.0) == pytest.approx({key: 0.6, second: 0.2})
    assert divide_closed_gap(both, 1.5, 50.0, 0.0) == pytest.approx({key: 0.03, second: 0.01})
    # A fault that the parameters of the set do not show closes nothing.
    assert divide_closed_gap({key: 1.0}, 1.5, 50.0, 40.0) == {key: 0.0}
