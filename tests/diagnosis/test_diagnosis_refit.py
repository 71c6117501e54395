"""Refits: what follows a stiffness follows it, intervals, twins, blocks that were doubted."""

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.corrections import doubted
from diagnosis.refit import FIRST, LAST, go_on, posed, refit, settled
from diagnosis.score import cosines, scores
from tests.helpers.drawn import drawn
from tuning import STAGES, Misfit, fit, thinned


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A campaign whose joint's centre of stiffness is elsewhere, and a fit with 10 %."""
    session, answer = drawn(
        tmp_path_factory.mktemp("coupled"), 72_021, "joint_coupling", ratio=6.0, lines=161
    )
    early = fit(session.model, session.campaign, varies=session.freedom, stages=STAGES[:3])
    return Scene(session, early.theta), early, answer


def only(scene, effect):
    return list(EFFECTS[effect](scene))


def test_a_stiffness_that_follows_another_has_its_value_and_moves_with_it(scene):
    scene, _, _ = scene
    for one in only(scene, "joint_coupling"):
        session = posed(scene, one, scene.session.campaign)
        varies = session.freedom
        assert varies.size == scene.session.freedom.size + 3
        x = np.random.default_rng(3).uniform(-0.2, 0.2, varies.size)
        theta = dict(zip((p.name for p in varies.parameters), varies.theta(x), strict=True))
        for name, other in one.follow.items():
            assert theta[name] == pytest.approx(theta[other], rel=1e-12)
        stage = STAGES[2]
        problem = stage.misfit(session.model, thinned(session.campaign, 16), varies)
        value, gradient = problem(x)
        way = np.random.default_rng(4).standard_normal(varies.size)
        step = 1e-5
        ends = [problem.value(x + sign * step * way) for sign in (1, -1)]
        assert value == pytest.approx(problem.value(x))
        assert gradient @ way == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4)


def test_intervals_hold_the_truth_and_the_gap_closes(scene):
    scene, _, answer = scene
    (true,) = [line for line in answer.splitlines() if line.startswith("offset")]
    offset = np.array([float(x) for x in true.partition("[")[2].rstrip("]").split(",")])
    place = answer.partition('location = "')[2].partition('"')[0]
    one = next(x for x in only(scene, "joint_coupling") if x.location == place)
    begun = refit(scene, one, scene.session.campaign, FIRST)
    found = settled(scene, go_on(scene, begun, LAST))
    assert found.chi_square < 1.1
    assert found.parameters()["offset"] == pytest.approx(offset, abs=0.03)
    low, high = np.array(found.intervals(one, found.fit.theta, 2)["offset"]).T
    middle = np.array(found.parameters()["offset"])
    assert (low < middle).all()
    assert (middle < high).all()
    # Twice as many lines as the fit counted.
    coarse = np.array(found.intervals(one, found.fit.theta, 4)["offset"]).T
    assert (coarse[1] - coarse[0] > 1.2 * (high - low)).all()
    # Six standard deviations: one case is no coverage, but an interval of another size is caught.
    assert (np.abs(offset - middle) < 3 * (high - low) / 2).all()
    # The linear twin: the posterior's covariance by numbers alone.
    stage = found.fit.last
    thin = thinned(found.session.campaign, stage.stride)
    varies = found.fit.freedom
    normal = Misfit(found.session.model, thin, varies, allowance=0.0).normal(found.fit.x)[2]
    many = len(thinned(found.session.campaign, 2).freq_hz) / len(thin.freq_hz)
    precision = np.where(varies.has_prior, 1.0, np.log(100.0) ** -2)
    whole = normal.dense() * many / max(1.0, found.chi_square) + np.diag(precision)
    own = [varies.names.index(name) for name in one.coordinates]
    deviation = 0.01 * np.sqrt(np.diag(np.linalg.inv(whole)))[own]
    assert (high - low) / 2 == pytest.approx(1.959964 * deviation, rel=1e-6)


def test_a_hypothesis_is_its_own_twin_and_strangers_are_none(scene):
    scene, early, _ = scene
    asked = [*only(scene, "joint_coupling"), *only(scene, "sensor_gain")[:2]]
    found = scores(scene, early, asked, 0.1)
    alike = cosines(scene, early, [found[0], *found], 0.1)
    assert np.diag(alike) == pytest.approx(1.0)
    assert alike[0, 1] == pytest.approx(1.0)
    assert alike == pytest.approx(alike.T)
    assert np.abs(alike).max() <= 1 + 1e-9
    gains = [row for row in found if row.hypothesis.effect == "sensor_gain"]
    own = [found.index(row) + 1 for row in gains]
    assert abs(alike[own[0], own[1]]) < 0.5


def test_lines_where_a_body_bends_are_doubted_by_as_much(scene):
    scene, _, _ = scene
    campaign = scene.session.campaign
    body = [dof for dof in campaign.outputs if dof.point.startswith("acc1")]
    softer = doubted(campaign, body, lambda freq_hz: 0.01 * freq_hz)
    for before, after in zip(campaign.tests, softer.tests, strict=True):
        frf = before.estimate.frf
        rows = np.array([dof.positive in [one.positive for one in body] for dof in frf.outputs])
        added = after.estimate.variance - before.estimate.variance
        assert not added[:, ~rows].any()
        mean = (np.abs(frf.values[:, rows]) ** 2).mean(axis=1)
        for row in np.flatnonzero(rows):
            assert added[:, row] == pytest.approx((0.01 * frf.freq_hz[:, None]) ** 2 * mean)
