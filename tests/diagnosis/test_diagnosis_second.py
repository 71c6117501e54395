"""A second effect: both are found, and one that is not needed falls."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import Scene, diagnose, verdict_of
from diagnosis.effects import missing_dof
from diagnosis.score import Score
from diagnosis.search import _elsewhere
from mbmodel import Held, loosened
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


def test_a_single_effect_needs_no_second(tmp_path):
    session, text = drawn(tmp_path, 72_061, "structural_damping", ratio=6.0)
    verdict = verdict_of(diagnose(session))
    answer = tomllib.loads(text)
    assert verdict.verdict == "explained"
    first = verdict.causes[0]
    assert (first.effect, first.location) == (answer["effect"], answer["location"])
    assert verdict.probability.several < 0.1


def test_a_direction_that_gives_way_by_far_is_found_though_its_slope_shows_nothing(tmp_path):
    session, _ = drawn(tmp_path, 72_062, "gyroscopic", ratio=6.0)
    _, held = loosened(session.model.machine, float(session.campaign.freq_hz.max()))
    assert held == ()  # all six directions have springs
    rows = [Score(one, 0.0, np.zeros(1)) for one in _ways(session)]
    (found,) = _elsewhere(rows, {("joint:stage2", "ry")}, {"drawn": 2.0})
    assert found.begin == {"drawn": 2.0, **found.otherwise[0]}
    assert _elsewhere(rows, {("joint:stage2", "rx")}, {}) == []
    sure = [replace(row, gain=5.0) for row in rows]
    assert _elsewhere(sure, {("joint:stage2", "ry")}, {}) == []


def _ways(session):
    """The hypothesis of a direction that is held."""
    machine = session.model.machine
    held = (Held("stage2", "ry", len(machine.coordinates) - 1, 1e8, 9e12, 1e-4),)
    (one,) = missing_dof.propose(Scene(session, session.model.drawn, held))
    name = one.coordinates[0]
    (begun,) = one.otherwise
    stated = one.state(begun | {name.replace("compliance", "time_constant"): 0})
    springs = [s.stiffness for s in machine.springs if s.location == "joint:stage2" and s.angular]
    assert stated["stiffness"] == pytest.approx(np.median(springs))
    return [one]
