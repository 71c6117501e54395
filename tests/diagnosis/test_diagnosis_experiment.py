"""The next experiment: the hit that tells two causes apart, or what confirms the one there is."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.experiment import next_experiment
from diagnosis.refit import CLOSE, refit
from identification import smooth_variance
from identification.words import Dof
from mbmodel import Evaluator, Question
from tests.helpers.drawn import drawn
from tuning import thinned


@pytest.fixture(scope="module")
def rivals(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("drawn"), 72_051, "mass_error", lines=81)
    scene = Scene(session, session.model.drawn)
    asked = list(EFFECTS["mass_error"](scene))[:2]
    return session, [refit(scene, one, session.campaign, CLOSE) for one in asked]


def found(session, refits, word, causes, where=()):
    """As much of a diagnosis as the next experiment reads."""
    judged = SimpleNamespace(word=word, causes=causes, where=where)
    search = SimpleNamespace(refits=refits)
    return SimpleNamespace(session=session, judged=judged, search=search)


def test_rivals_are_told_apart_where_they_differ_most(rivals):
    session, (one, other) = rivals
    causes = [(one.hypothesis.key, 0.6), (other.hypothesis.key, 0.3)]
    said = next_experiment(found(session, (one, other), "explained", causes))
    assert one.hypothesis.site in said
    assert other.hypothesis.site in said
    point = said.split()[1]
    campaign = session.campaign
    hit = {test.condition.reference.point for test in campaign.tests}
    frf = campaign.tests[0].estimate.frf
    read = {dof.point for dof in frf.outputs}
    assert point in read - hit

    def apart(at):
        inputs = tuple(Dof.of(at, axis) for axis in range(3))
        thin = thinned(campaign, 8)
        question = Question(thin.freq_hz, frf.outputs, inputs, frf.quantity)
        ends = [Evaluator(r.session.model, question).at(r.fit.theta).values for r in (one, other)]
        noise = np.mean([smooth_variance(t.estimate)[:, :, 0] for t in thin.tests], axis=0)
        return np.sqrt((np.abs(ends[0] - ends[1]) ** 2 / noise[:, :, None]).mean())

    best = max(sorted(read - hit), key=apart)
    assert point == best
    assert float(said.split()[-2]) == pytest.approx(apart(best), rel=0.06)


def test_a_single_cause_is_confirmed_in_its_own_way(rivals):
    session, (one, other) = rivals
    causes = [(one.hypothesis.key, 0.95), (other.hypothesis.key, 0.02)]
    said = next_experiment(found(session, (one, other), "explained", causes))
    assert said.startswith(f"weigh {one.hypothesis.location.partition(':')[2]}")
    proven = [(("sensor_swap", "sensor:acc1", "tx+ty"), 0.98)]
    assert "knock" in next_experiment(found(session, (), "explained", proven))


def test_what_nobody_explains_is_asked_at_other_levels_where_it_pushes(rivals):
    session, _ = rivals
    said = next_experiment(found(session, (), "unexplained", [], [("joint:a", 0.8)]))
    assert "four times the level" in said
    assert "joint:a" in said
    assert next_experiment(found(session, (), "none", [])) is None
