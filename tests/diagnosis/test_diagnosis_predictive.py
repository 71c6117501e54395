"""Rivals by what they foretell of lines and hits that their fits did not see."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.comparison.confounded import find_confounded
from diagnosis.comparison.predictive import at_ease, foretold, rivals_of
from diagnosis.hypothesis_set import together
from diagnosis.inference.posterior import Posterior
from diagnosis.refits import refitting
from diagnosis.refits.refitting import (
    FIRST,
    LAST,
    LONG,
    SOME,
    fitted,
    further,
    held_out,
    plenty,
    refit,
    unbounded,
)
from diagnosis.search.ladder import Search
from diagnosis.search.score_test import cosines, scores
from identification import smooth_variance
from tests.helpers.drawn import drawn
from tuning import STAGES, Misfit, fit, thin_lines
from tuning.misfit.weights import FORCE_ERROR_FLOOR


@pytest.fixture(scope="module")
def rivals(tmp_path_factory):
    session, text = drawn(tmp_path_factory.mktemp("drawn"), 72_051, "mass_error", lines=161)
    early = fit(
        session.model, session.campaign, parametrisation=session.parametrisation, stages=STAGES[:3]
    )
    scene = Scene(session, early.theta)
    several = list(EFFECTS["mass_error"](scene))
    right = next(one for one in several if one.location in text)
    wrong = next(one for one in several if one is not right)
    campaign = session.campaign
    return scene, [refit(scene, one, campaign, (*FIRST, *LAST, *LONG)) for one in (right, wrong)]


def student(squares):
    """Minus log density, but for constants, of noise whose variance two values tell."""
    return 3 * np.log1p(squares / 2)


def cost(estimates, predicted, law):
    """Sum of a law of |r|^2 over the noise and the floor of what fits can hold."""
    total = 0.0
    for estimate, values in zip(estimates, predicted, strict=True):
        at = [dof.point for dof in estimate.frf.outputs]
        power = np.abs(estimate.frf.values[:, :, 0]) ** 2 @ np.equal.outer(at, at)
        noise = smooth_variance(estimate)[:, :, 0] + FORCE_ERROR_FLOOR**2 * power
        off = values[:, :, 0] - estimate.frf.values[:, :, 0]
        total += law(np.abs(off) ** 2 / noise).sum()
    return total


def test_the_right_cause_foretells_what_the_wrong_one_does_not(rivals):
    scene, (right, wrong) = rivals
    good, bad = foretold(scene, (right, wrong))
    assert bad > 3 * good


def test_where_twice_as_much_was_measured_than_is_enough_half_the_score_counts(rivals, monkeypatch):
    scene, (right, _) = rivals
    (score,) = foretold(scene, (right,))
    assert plenty(right.session.campaign) < 1
    enough = plenty(right.session.campaign) * refitting._ENOUGH / 2
    monkeypatch.setattr(refitting, "_ENOUGH", enough)
    assert plenty(right.session.campaign) == pytest.approx(2)
    assert foretold(scene, (right,)) == [pytest.approx(score / 2, rel=1e-12)]


def test_a_score_is_the_cost_of_what_was_left_out(rivals):
    scene, (right, _) = rivals
    (score,) = foretold(scene, (right,))
    campaign, model = right.session.campaign, right.session.model
    held = held_out(right, SOME)
    lines = cost([test.estimate for test in campaign.tests], held.predict(model, campaign), student)
    hits, thin = 0.0, thin_lines(campaign, SOME.stride)
    whole = Misfit(model, thin, right.session.parametrisation, model_error_floor=0.0).value(
        right.fit.x
    )
    for test in campaign.tests:  # three, each along a direction of its own
        others = tuple(one for one in campaign.tests if one is not test)
        without = replace(right.session, campaign=replace(campaign, tests=others))
        few = thin_lines(without.campaign, SOME.stride)
        (made,) = fitted(scene, [further(replace(right, session=without), (*LAST, *LONG))])
        problem = Misfit(model, few, right.session.parametrisation, model_error_floor=0.0)
        hits += (whole - problem.value(made.fit.x)) * SOME.stride
    assert score == pytest.approx((lines + hits) / 2, rel=0.02)
    values = right.fit.cost / right.chi_square * SOME.stride
    assert hits == pytest.approx(values, rel=0.2)  # each is left out once


def test_where_nothing_can_be_left_out_nothing_is_foretold(rivals):
    scene, (right, _) = rivals
    campaign = replace(right.session.campaign, tests=right.session.campaign.tests[:1])
    few = np.arange(len(campaign.freq_hz)) < 8
    session = replace(right.session, campaign=campaign.select_lines(few))
    assert foretold(scene, (replace(right, session=session),)) == [None]


def test_pairs_are_rivals_as_single_causes_are(rivals):
    _, (right, wrong) = rivals
    first, second = right.hypothesis, wrong.hypothesis
    third = replace(second, location="body:third")
    pairs = [replace(right, hypothesis=together((first, one))) for one in (second, third)]
    shares = {
        (first.key, second.key): 0.3,
        (first.key, third.key): 0.6,
        (second.key, third.key): 0.05,  # nobody fitted these together
        (first.key,): 0.05,
    }
    present = (third.key, first.key)
    judged = Posterior(0.0, 0.0, 0.95, (), (), present, tuple(shares.items()))
    search = Search(refits=(right, wrong), pairs=tuple(pairs))
    found = rivals_of(judged, search)
    expected = [((first.key, third.key), pairs[1], 0.6), ((first.key, second.key), pairs[0], 0.3)]
    assert found == expected
    # Likewise beside what a gate proved; of single causes those; of what is not there none.
    proven = ("sensor_gain", "sensor:acc1", None)
    assert rivals_of(replace(judged, present=(proven, *present)), search) == expected
    alone = rivals_of(replace(judged, present=(proven, first.key)), search)
    assert alone == [((first.key,), right, 0.05)]
    assert rivals_of(replace(judged, present=(proven,)), search) == []
    assert rivals_of(replace(judged, sets=()), search) == []


def test_steps_that_a_fit_has_left_are_not_what_left_out_hits_cost(rivals):
    # A refit that is short of its minimum goes on where hits are left out: no merit of theirs.
    scene, (right, _) = rivals
    free = right.fit.parametrisation.has_prior
    x = np.where(free, right.fit.x + 0.003, right.fit.x)
    short = replace(right, fit=replace(right.fit, x=x))
    (score,), (worse,) = foretold(scene, (right,)), foretold(scene, (short,))
    assert worse == pytest.approx(score, rel=0.01)


def test_a_tolerance_beyond_its_bound_does_not_decide_between_rivals(tmp_path):
    # The axes of acc11 are off by 3.2 standard deviations, and a mass is.
    session, text = drawn(tmp_path, 72_200, "mass_error", lines=161)
    early = fit(
        session.model, session.campaign, parametrisation=session.parametrisation, stages=STAGES[:3]
    )
    scene = Scene(session, early.theta)
    several = list(EFFECTS["mass_error"](scene))
    right = next(one for one in several if one.location in text)
    wrong = next(one for one in several if one is not right)
    stages = (*FIRST, *LAST, *LONG)
    good, bad = (refit(scene, one, session.campaign, stages) for one in (right, wrong))
    assert good.gap > 0.1
    good = unbounded(scene, good)
    assert 2.5 < good.pull < 4.5
    shares = (((good.key,), 0.5), ((bad.key,), 0.4))
    judged = Posterior(0.0, 0.05, 0.0, (), (), (good.key,), shares)
    found = Search(refits=(good, bad))
    eased = at_ease(scene, found, judged, 4.5)
    assert eased.refits[0].key == good.key
    assert eased.refits[0].gap < 0.1 * good.gap
    assert eased.refits[0].cost < good.cost
    # Nothing changes where no outlier explains what is left, or no rival is there.
    assert at_ease(scene, found, judged, 2.6) is found
    assert at_ease(scene, found, replace(judged, sets=shares[:1]), 4.5) is found


def test_twins_are_alike_or_as_likely_and_named_once_the_likelier_first(rivals):
    scene, (right, wrong) = rivals
    scored = tuple(scores(scene, right.fit, [wrong.hypothesis, right.hypothesis], 0.03))
    tried = Search(scores=scored, refits=(right, wrong))
    evidence = SimpleNamespace(refits=())
    sites = right.hypothesis.site, wrong.hypothesis.site

    def twins(share, costs):
        found = [
            replace(one, fit=replace(one.fit, cost=cost))
            for one, cost in zip(tried.refits, costs, strict=True)
        ]
        causes = ((right.key, 0.97 - share), (wrong.key, share))
        judged = Posterior(0.0, 0.0, 0.0, causes, (), (), tuple(((key,), p) for key, p in causes))
        return find_confounded(
            scene, right.fit, evidence, judged, replace(tried, refits=tuple(found))
        )

    assert abs(cosines(scene, right.fit, list(scored), 0.03)[0, 1]) < 0.9
    assert twins(0.02, (10.0, 20.0)) == ()
    assert twins(0.02, (10.0, 12.0)) == (sites,)  # by 2 nats
    assert twins(0.3, (10.0, 20.0)) == (sites,)  # by what decides anything
    assert twins(0.3, (10.0, 12.0)) == (sites,)
