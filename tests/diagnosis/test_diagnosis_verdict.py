"""Whole diagnoses of small machines, from files that truth wrote to a verdict that it grades."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from diagnosis import EFFECTS, build_verdict, diagnose, refit_true_cause
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import compute_posterior
from diagnosis.search.score_test import scores
from identification import Fault
from mbw.command import app
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, refit_null
from truth.grade.read_verdict import read_verdict
from tuning import UserSpecification, fit, parametrise
from tuning.fitting import error_floor_fit

CASES = {
    "none": (72_010, None, None),
    "sensor_polarity": (72_011, "sensor_polarity", None),
    "drift": (72_012, "drift", 6.0),
    "gyroscopic": (72_013, "gyroscopic", 6.0),
}


@pytest.fixture(scope="module", params=CASES)
def case(request, tmp_path_factory):
    seed, effect, ratio = CASES[request.param]
    folder = tmp_path_factory.mktemp("case")
    lines = 161 if effect else 241  # of an excess of 1 within 0.2
    session, answer = drawn(folder, seed, effect, ratio=ratio, lines=lines)
    return folder, tomllib.loads(answer), diagnose(session)


def test_effect_and_place_are_named_and_the_gap_closes(case, tmp_path):
    _, answer, found = case
    verdict = build_verdict(found)
    file = tmp_path / "verdict.json"
    file.write_text(verdict.model_dump_json())
    read_verdict(file)  # as the judge reads it
    if answer["effect"] == "none":
        assert verdict.verdict == "none"
        assert not verdict.causes
        assert verdict.probability.none > 0.7
        assert verdict.gap.retuned.excess == pytest.approx(1.0, abs=0.2)
        assert verdict.gap.after.excess is None
        return
    assert verdict.verdict == "explained"
    first = verdict.causes[0]
    assert (first.effect, first.location) == (answer["effect"], answer["location"])
    if first.dof is not None:
        assert first.dof == answer["dof"]
    assert verdict.where[0].location == answer["location"]
    assert verdict.gap.retuned.excess > 1.2
    assert verdict.gap.closed > 0.8
    low, high = verdict.gap.interval.after
    assert low < verdict.gap.after.excess < high
    assert verdict.gap.interval.closed[0] < verdict.gap.closed < verdict.gap.interval.closed[1]
    for name, ends in first.interval.items():
        below, above = np.array(ends).T
        assert np.all(below < first.parameters[name])
        assert np.all(first.parameters[name] < above)
    if answer["effect"] == "drift":
        assert first.parameters["factor"] == pytest.approx(answer["parameters"]["factor"], rel=0.1)


def test_who_is_told_the_effect_reaches_what_was_reached(case):
    _, answer, found = case
    if answer["effect"] == "none":
        return
    told = Fault(answer["effect"], answer["location"], answer.get("dof"), 1.0, {}, 1.0)
    assert refit_true_cause(found, told) is found.after
    if answer["effect"] == "gyroscopic":  # who is told something else fits that
        other = next(
            one.hypothesis for one in found.search.scores if one.hypothesis.effect == "drift"
        )
        level = refit_true_cause(found, Fault("drift", other.location, other.dof, 1.0, {}, 1.0))
        # On lines that it did not see, a wrong effect may do worse than none.
        assert 2 * found.after.gap.excess < level.gap.excess < 3 * found.retuned.gap.excess
        assert (
            refit_true_cause(found, Fault("backlash", other.location, None, 1.0, {}, 1.0)) is None
        )


def test_what_only_spare_channels_show_is_not_excluded_where_there_are_none(case):
    _, _, found = case
    beside = {"sensor_delay", "sensor_swap", "flexible_body"}
    assert not beside & set(build_verdict(found).not_testable)
    first, *others = found.checks.bodies
    checks = replace(found.checks, bodies=(replace(first, redundant=1), *others))
    assert beside < set(build_verdict(replace(found, checks=checks)).not_testable)


def test_a_body_without_any_sensor_may_bend_unseen(case):
    _, _, found = case
    checks = replace(found.checks, bodies=found.checks.bodies[1:])
    missing = build_verdict(replace(found, checks=checks)).not_testable
    assert "flexible_body" in missing
    assert "sensor_swap" not in missing  # where there is no sensor none is exchanged


def test_laws_need_two_levels_and_the_level_of_every_test(case):
    _, _, found = case
    laws = {"friction", "backlash", "hardening"}

    def not_testable(*levels):
        tests = tuple(
            replace(test, condition=replace(test.condition, level_n=level))
            for level in levels
            for test in found.session.campaign.tests
        )
        campaign = replace(found.session.campaign, tests=tests)
        leveled = replace(found, session=replace(found.session, campaign=campaign))
        return set(build_verdict(leveled).not_testable)

    assert laws <= not_testable(200.0)
    assert laws <= not_testable(200.0, None)
    assert not laws & not_testable(200.0, 900.0)


def test_a_tolerance_that_is_kept_as_drawn_is_not_tested_where_no_gate_asks(case):
    _, _, found = case
    session = found.session
    gains = {"sensor_gain", "sensor_position", "hammer_misalignment"}
    assert not gains & set(build_verdict(found).not_testable)
    fix = UserSpecification(fix=("*.gain_x", "hammer(*).rotation_*"))
    varies = parametrise(session.model, session.campaign.tolerance, fix)
    kept = replace(found, session=replace(session, parametrisation=varies))
    assert gains & set(build_verdict(kept).not_testable) == {"hammer_misalignment"}
    checks = tuple(replace(one, redundant=1) for one in found.checks.bodies)
    blind = replace(kept, checks=replace(found.checks, bodies=checks))
    assert gains & set(build_verdict(blind).not_testable) == {"sensor_gain", "hammer_misalignment"}


def test_the_verdict_is_the_same_with_more_processes_and_by_the_command(case):
    folder, answer, found = case
    if answer["effect"] != "drift":
        return
    out = folder / "out"
    arguments = ["diagnose", str(folder / "campaign"), "--out", str(out), "--jobs", "2"]
    run = CliRunner().invoke(app, [*arguments, "--json", "-"])
    assert run.exit_code == 0, run.stderr
    stated = json.loads(run.stdout)
    assert stated == json.loads((out / "verdict.json").read_text())
    assert stated == json.loads(build_verdict(found).model_dump_json())
    evidence = Evidence.model_validate_json((out / "evidence.json").read_text())
    assert evidence == found.evidence
    assert compute_posterior(evidence) == found.posterior  # without any fit


def test_an_interrupt_ends_it_without_a_verdict(tmp_path, monkeypatch):
    session, _ = drawn(tmp_path, 72_015, lines=121)
    monkeypatch.setattr(
        error_floor_fit, "fit", lambda *a, **k: replace(fit(*a, **k), outcome="interrupted")
    )
    with pytest.raises(KeyboardInterrupt):
        diagnose(session)
    out = tmp_path / "out"
    run = CliRunner().invoke(app, ["diagnose", str(tmp_path / "campaign"), "--out", str(out)])
    assert run.exit_code == 130
    assert not (out / "verdict.json").exists()


def test_sizes_are_not_fitted_below_zero(case):
    _, _, found = case
    for refit in found.search.refits:
        names = refit.fit.parametrisation.names
        for cause in refit.causes:
            if cause.signed:
                assert min(refit.fit.x[names.index(name)] for name in cause.coordinates) >= 0


def test_scores_come_the_most_promising_first(tmp_path):
    session, _ = drawn(tmp_path, 72_014, "joint_coupling", ratio=1.0)
    scene = early_scene(session)
    null = refit_null(scene)
    proposed = list(EFFECTS["joint_coupling"](scene)) + list(EFFECTS["drift"](scene))
    scored = scores(scene, null.fit, proposed, null.floor, 12)
    assert [one.gain for one in scored] == sorted((one.gain for one in scored), reverse=True)
    assert len(scored) == len(proposed)
    assert all(one.gain >= 0 and np.isfinite(one.step).all() for one in scored)


def test_without_a_model_there_is_one_sentence(tmp_path):
    (tmp_path / "campaign.toml").write_text('layout = "layout.toml"\n')
    run = CliRunner().invoke(app, ["diagnose", str(tmp_path)])
    assert run.exit_code == 3
    assert len(run.stderr.strip().splitlines()) == 1
