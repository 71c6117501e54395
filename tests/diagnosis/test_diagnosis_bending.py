"""A body that bends: proven by its spare channels, fitted, and the gap closed with it."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS, build_verdict, diagnose
from diagnosis.effects.flexible_body import build_bending_hypothesis
from diagnosis.known_cause_bound import refit_true_cause
from diagnosis.refits.refitting import add_hypotheses
from identification import Fault, estimate_bending_shape
from tests.helpers.drawn import drawn
from tuning import predict, rebuild_for_machine


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    session, answer = drawn(tmp_path_factory.mktemp("bent"), 72_070, "flexible_body", ratio=6.0)
    return diagnose(session), tomllib.loads(answer)


def test_the_mode_is_found_and_the_gap_closes(case):
    found, answer = case
    verdict = build_verdict(found)
    (cause, *_) = verdict.causes
    assert (cause.effect, cause.location) == (answer["effect"], answer["location"])
    assert verdict.gap.retuned.excess > 2
    assert verdict.gap.closed > 0.95
    assert not verdict.rest.significant
    for name, true in answer["parameters"].items():
        low, high = cause.interval[name]
        assert cause.parameters[name] == pytest.approx(true, rel=0.1)
        assert abs(true - (low + high) / 2) < 3 * (high - low) / 2


def test_who_is_told_the_effect_does_no_better(case):
    found, answer = case
    told = Fault(answer["effect"], answer["location"], None, 1.0, {}, 1.0)
    assert refit_true_cause(found, told) is found.after
    # Made anew, as where the diagnosis had named something else.
    level = refit_true_cause(replace(found, gaps=replace(found.gaps, after=None)), told)
    assert level is not None
    assert level.gap.excess == pytest.approx(build_verdict(found).gap.after.excess, rel=0.02)


def test_a_first_guess_is_the_peak_and_no_rigid_motion(case):
    found, answer = case
    campaign = found.session.campaign
    body = answer["location"].partition(":")[2]
    seen = estimate_bending_shape(campaign, body)
    channels, readings = list(seen.readings), np.array(list(seen.readings.values()))
    number = campaign.layout.bodies.index(body)
    rows = campaign.layout.rows(channels)[:, 6 * number : 6 * number + 6]
    assert np.abs(readings).max() == pytest.approx(1.0)
    assert rows.T @ readings == pytest.approx(np.zeros(6), abs=1e-9)
    values = np.stack([t.estimate.frf.values[:, :, 0] for t in campaign.tests])
    places = [campaign.outputs.index(dof) for dof in channels]
    power = (np.abs(values[:, :, places] @ readings) ** 2).sum(axis=0)
    assert campaign.freq_hz[power.argmax()] == pytest.approx(seen.frequency, abs=1.5)


def test_a_body_that_bends_before_a_change_gets_no_second_mode(case):
    diagnosis, _ = case
    fault = Fault("flexible_body", diagnosis.present.causes[0].location, None, 1.0, {}, 1.0)
    body = fault.location.partition(":")[2]
    for session, is_sought in ((diagnosis.session, True), (diagnosis.after.refit.session, False)):
        hypothesis = build_bending_hypothesis(fault, (body,), session, diagnosis.checks.campaign)
        assert hypothesis.is_modelled is is_sought


def test_the_same_parts_are_made_for_another_machine(case):
    found, _ = case
    model = found.scene.session.model
    (one,) = found.present.causes
    wider = rebuild_for_machine(model, one.reform(model.machine))
    assert wider.parameters == model.parameters
    before, after = model.matrices(model.drawn), wider.matrices(wider.drawn)
    nv = len(model.machine.coordinates)
    assert after.stiffness[:nv, :nv] == pytest.approx(before.stiffness)
    assert after.mass[:nv, :nv] == pytest.approx(before.mass)
    assert not after.mass[:nv, nv:].any()


@pytest.mark.parametrize("effect", ["parallel_path", "appendage", "feedback_delay", "drift"])
def test_causes_of_the_machine_before_stay_on_the_wider_machine(case, effect):
    """A state before a change may have causes, and a body may bend after it."""
    found, _ = case
    (bending,) = found.present.causes
    cause = next(each for each in EFFECTS[effect](found.scene) if each.parts)
    session = add_hypotheses(found.scene.session, cause)
    theta = np.array([p.drawn or 0.3 for p in session.model.parameters])
    wider = rebuild_for_machine(session.model, bending.reform(session.model.machine))
    assert wider.parameters == session.model.parameters
    campaign = session.campaign
    for got, wanted in zip(
        predict(wider, theta, campaign), predict(session.model, theta, campaign), strict=True
    ):
        np.testing.assert_allclose(got, wanted, rtol=1e-5, atol=1e-7 * np.abs(wanted).max())
