"""Refits: what follows a stiffness follows it, intervals, null model, shifts of tolerances."""

import tomllib
from collections import namedtuple
from dataclasses import replace
from math import erfc, exp, pi, sqrt

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.corrections import mask_channels
from diagnosis.estimates.intervals import fit_parameters
from diagnosis.hypothesis import Hypothesis
from diagnosis.null_model import fit_null_model, refit_from
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import (
    RefitTask,
    add_cause,
    add_hypotheses,
    admit_outliers,
    find_start,
    run_refits,
)
from diagnosis.search.score_test import compute_cosines, scores
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, propose_at, refit_null, refit_with
from tuning import STAGES, Misfit, fit, thin_lines

SHORT = replace(SETTINGS.schedule, max_turns=1)
Ended = namedtuple("Ended", "x parametrisation")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A joint whose centre of stiffness is elsewhere: scene, null model, refit, answer."""
    session, answer = drawn(
        tmp_path_factory.mktemp("coupled"), 72_021, "joint_coupling", ratio=6.0, lines=161
    )
    answer = tomllib.loads(answer)
    scene = early_scene(session)
    null = refit_null(scene)
    (cause,) = propose_at(scene, "joint_coupling", answer["location"])
    return scene, null, refit_with(scene, null, cause), answer


def only(scene, effect):
    return list(EFFECTS[effect](scene))


def test_a_stiffness_that_follows_another_has_its_value_and_moves_with_it(case):
    scene, *_ = case
    for one in only(scene, "joint_coupling"):
        session = add_hypotheses(scene.session, one)
        varies = session.parametrisation
        assert varies.size == scene.session.parametrisation.size + 3
        x = np.random.default_rng(3).uniform(-0.2, 0.2, varies.size)
        theta = dict(zip((p.name for p in varies.parameters), varies.theta(x), strict=True))
        for name, other in one.follow.items():
            assert theta[name] == pytest.approx(theta[other], rel=1e-12)
        stage = STAGES[2]
        problem = stage.build_misfit(session.model, thin_lines(session.campaign, 16), varies)
        value, gradient = problem(x)
        way = np.random.default_rng(4).standard_normal(varies.size)
        step = 1e-5
        ends = [problem.value(x + sign * step * way) for sign in (1, -1)]
        assert value == pytest.approx(problem.value(x))
        assert gradient @ way == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4)


def test_intervals_hold_the_truth_and_the_gap_closes(case):
    _, null, refit, answer = case
    offset = np.array(answer["parameters"]["offset"])
    (cause,) = refit.causes
    assert null.gap > 5
    assert refit.gap < 0.1
    assert refit.floor < 0.2 * null.floor  # what a cause is worth
    assert refit.state_parameters(cause)["offset"] == pytest.approx(offset, abs=0.03)
    fitted = fit_parameters(refit)
    low, high = np.array(fitted.estimate_intervals(cause)["offset"]).T
    middle = np.array(fitted.state_parameters(cause)["offset"])
    assert (low < middle).all()
    assert (middle < high).all()
    # Springs and dampers elsewhere, or a joint that is not where the drawing has it: no test tells.
    tolerance = 2 * 1.96 * refit.session.campaign.tolerance.joint_position
    assert (high - low > 0.99 * tolerance).all()
    assert (high - low < 1.5 * tolerance).all()
    # Six standard deviations: one case is no coverage, but an interval of another size is caught.
    assert (np.abs(offset - middle) < 3 * (high - low) / 2).all()


def test_ends_of_a_positive_number_are_those_of_its_logarithm(case):
    _, null, *_ = case
    fitted = fit_parameters(null, 4)
    name = next(n for n in fitted.parametrisation.names if n.endswith(".damping"))
    one = Hypothesis("missing_dof", "joint:a", state=lambda at: {"damping": at[name]})
    place = fitted.parametrisation.names.index(name)
    width = 1.959964 * fitted.confidence.deviation[place]
    (low, high), middle = (
        fitted.estimate_intervals(one)["damping"],
        fitted.state_parameters(one)["damping"],
    )
    logarithm = varied(fitted.parametrisation, fitted.confidence.x, place, width)[name]
    assert high == pytest.approx(logarithm, rel=1e-6)
    assert 0 < low < middle < high
    assert middle / low == pytest.approx(high / middle, rel=1e-6)


def test_variance_of_intervals_grows_with_values_over_independent_ones(case):
    _, null, *_ = case
    name = next(n for n in null.fit.parametrisation.names if n.endswith(".damping"))
    one = Hypothesis("missing_dof", "joint:a", state=lambda at: {"damping": at[name]})

    def variance(share):  # that of the weights, and a constant: the jackknife's over bands of lines
        count = share * null.summary.values
        shared = null.summary.model_copy(update={"noise_share": 0.5, "effective_values": count})
        low, high = fit_parameters(replace(null, summary=shared)).estimate_intervals(one)["damping"]
        return np.log(high / low) ** 2

    few, fewer, fewest = (variance(1 / values) for values in (8, 16, 32))
    # Linear, but for the priors, which limit what the data leave open.
    assert 1.4 * (fewer - few) < fewest - fewer < 2.1 * (fewer - few)
    assert fewer - few > 0.1 * few


def varied(varies, x, place, by):
    """Parameters with one coordinate elsewhere."""
    theta = varies.theta(x + by * (np.arange(len(x)) == place))
    return dict(zip((p.name for p in varies.parameters), theta, strict=True))


def test_what_was_found_does_not_depend_on_the_bounds_of_tolerances(case):
    _, _, refit, _ = case
    (cause,) = refit.causes
    free = fit_parameters(refit)
    varies = refit.fit.parametrisation
    narrow = np.where(varies.is_tolerance, 0.5, np.inf)
    half = replace(
        varies, lower=np.maximum(varies.lower, -narrow), upper=np.minimum(varies.upper, narrow)
    )
    tight = fit(
        refit.session.model,
        refit.session.campaign,
        parametrisation=half,
        starts=(refit.fit.theta,),
        stages=(STAGES[4],),
    )
    low, high = (
        np.array(ends) for ends in zip(*free.estimate_intervals(cause)["offset"], strict=True)
    )
    middle, deviation = np.array(free.state_parameters(cause)["offset"]), (high - low) / 3.92
    tightened = replace(refit, fit=replace(tight, parametrisation=varies))
    pushed = tightened.state_parameters(cause)["offset"]
    assert (np.abs(pushed - middle) > 2 * deviation).any()  # bounds that truth is beyond push it
    again = np.array(fit_parameters(tightened).state_parameters(cause)["offset"])
    assert (np.abs(again - middle) < 0.3 * deviation).all()


def test_a_hypothesis_is_confounded_with_itself_and_strangers_are_not(case):
    scene, null, *_ = case
    hypotheses = [*only(scene, "joint_coupling"), *only(scene, "sensor_gain")[:2]]
    ranked = scores(scene, null.fit, hypotheses, 0.1, 8)
    alike = compute_cosines(scene, null.fit, [ranked[0], *ranked], 0.1, 8)
    assert np.diag(alike) == pytest.approx(1.0)
    assert alike[0, 1] == pytest.approx(1.0)
    assert alike == pytest.approx(alike.T)
    assert np.abs(alike).max() <= 1 + 1e-9
    first, second = (
        k + 1 for k, row in enumerate(ranked) if row.hypothesis.effect == "sensor_gain"
    )
    assert abs(alike[first, second]) < 0.5


def test_the_score_is_the_gain_of_the_quadratic_model_where_all_else_is_tuned(case):
    scene, null, *_ = case
    cause = only(scene, "gyroscopic")[-1]
    stride, floor = 8, null.floor
    inner = replace(scene, session=null.session, theta=null.fit.theta)
    (score,) = scores(inner, null.fit, [cause], floor, stride)
    # The slower twin: the whole normal equations, and the coordinates that no bound holds.
    session = add_hypotheses(null.session, cause)
    varies = session.parametrisation
    x = varies.coordinates(find_start(null, session, cause))
    thin = thin_lines(session.campaign, stride)
    problem = Misfit(session.model, thin, varies, model_error_floor=floor)
    _, gradient, normal = problem.quadratic_model(x)
    matrix = normal.dense() + np.diag(varies.precision)
    bound = varies.coordinates_at_bound(x)
    added = np.arange(varies.size) >= null.fit.x.size

    def gain(free):
        block, slope = matrix[np.ix_(free, free)], gradient[free]
        scale = 1 / np.sqrt(np.diag(block))
        step = np.linalg.solve(block * np.outer(scale, scale), slope * scale)
        return 0.5 * (slope * scale) @ step

    expected = gain(np.flatnonzero(~bound | added)) - gain(np.flatnonzero(~bound & ~added))
    assert score.gain == pytest.approx(expected, rel=1e-4)


def test_of_few_frfs_the_null_model_is_fitted_from_many_starts(tmp_path):
    session, _ = drawn(tmp_path, 72_064, None, lines=161)
    kept = {str(dof) for dof in session.campaign.outputs[::9]}
    few = mask_channels(session.campaign, lambda dof: str(dof) not in kept)
    names = [parameter.name for parameter in session.model.parameters]
    stiff = np.array([name.startswith("stage2") and name.endswith("stiffness") for name in names])
    model = replace(session, campaign=few).model
    scene = Scene(replace(session, campaign=few), np.where(stiff, 1e3, 1.0) * model.drawn)
    assert fit_null_model(scene, SETTINGS).gap < 0.2


def test_the_null_model_is_fitted_once_more_from_where_an_effect_that_vanished_ended(tmp_path):
    session, _ = drawn(tmp_path, 72_064, None, lines=161)
    scene = Scene(session, session.model.drawn)
    names = [parameter.name for parameter in session.model.parameters]
    stiff = np.array([name.startswith("stage2") and name.endswith("stiffness") for name in names])
    null = refit_null(scene)
    assert null.gap < 0.1
    far = np.where(stiff, 1e3, 1.0) * session.model.drawn
    stuck = fit(
        session.model,
        session.campaign,
        parametrisation=session.parametrisation,
        starts=(far,),
        stages=(replace(STAGES[3], max_steps=1, stride=8),),
    )

    def at_cost(more):
        return null.summary.model_copy(update={"cost": null.summary.cost + more})

    poor = replace(null, fit=stuck, summary=at_cost(5.0))
    seeming = run_refits(scene, [add_cause(null, only(scene, "structural_damping")[0])], SHORT)[0]
    better = refit_from(scene, poor, seeming, SETTINGS)
    assert better.causes == ()
    assert better.objective < poor.objective
    assert better.gap < 0.1
    # Where nothing better is found, the null model stays.
    best = replace(null, summary=at_cost(-5.0))
    assert refit_from(scene, best, seeming, SETTINGS) is best


def test_tolerances_beyond_their_bounds_are_followed_as_far_as_an_outlier_may(tmp_path):
    # The axes of acc11 are off by 3.2 standard deviations.
    session, _ = drawn(tmp_path, 72_200, None, lines=161)
    scene = early_scene(session)
    (null,) = run_refits(scene, [RefitTask((), session, None, 0.1)], SETTINGS.schedule)
    assert null.gap > 0.5
    assert refit_null(scene).gap < 0.1  # admits them itself
    (admitted,) = admit_outliers(scene, [null], SETTINGS)
    assert admitted.gap < 0.1
    shifts = np.abs(admitted.fit.x[admitted.session.parametrisation.is_tolerance])
    assert 3 < shifts.max() < 4
    # What was no outlier keeps its bound, and a shift beyond the largest outlier is a fault.
    widened = admitted.session.parametrisation.upper > null.session.parametrisation.upper
    assert 1 <= widened.sum() < 20
    assert admit_outliers(scene, [null], replace(SETTINGS, outlier_sigma=2.8)) == [null]
    assert admit_outliers(scene, [admitted], SETTINGS) == [admitted]
    # Others that were driven to their bounds, more than by chance, come back.
    x = null.fit.x.copy()
    driven = np.flatnonzero(null.session.parametrisation.is_tolerance)[::4]
    x[driven] = null.session.parametrisation.upper[driven]
    (from_bounds,) = admit_outliers(scene, [replace(null, fit=replace(null.fit, x=x))], SETTINGS)
    assert from_bounds.gap < 0.1
    # Beside a cause too, which otherwise looks as if the model had errors beside it.
    stiffer = refit_with(scene, null, only(scene, "structural_damping")[0])
    (beside,) = admit_outliers(scene, [stiffer], SETTINGS)
    assert beside.keys == stiffer.keys
    assert beside.gap < 0.1 < stiffer.gap
    # The same tolerances released are that outlier too, as unlikely as one alone.
    (turned,) = propose_at(scene, "sensor_misalignment", "sensor:acc11")
    released = refit_with(scene, null, turned)
    assert 2.5 < released.tolerance_shift(turned) < 4


def test_how_far_released_tolerances_are_off_counts_how_many_they_are(case):
    scene, null, *_ = case
    gain, turn = (only(scene, effect)[0] for effect in ("sensor_gain", "sensor_misalignment"))
    names = np.array(scene.session.parametrisation.names)

    def shifted(values):
        x = np.zeros(len(names))
        for name, value in values.items():
            x[names == name] = value
        ended = Ended(x, scene.session.parametrisation)
        return Refit((), scene.session, ended, null.summary)

    def shift(values, cause):
        return shifted(values).tolerance_shift(cause)

    assert shift(dict.fromkeys(gain.release, -3.7), gain) == pytest.approx(3.7)
    assert shift({}, turn) == pytest.approx(0, abs=1e-9)
    # Of three the sum of squares is chi square with three degrees of freedom: here in closed form.
    for far in (1.0, 2.0, 6.0):
        tail = erfc(far / sqrt(2)) + sqrt(2 / pi) * far * exp(-(far**2) / 2)
        z = shift({turn.release[1]: far}, turn)
        assert erfc(z / sqrt(2)) == pytest.approx(tail, rel=1e-9)
    assert np.isfinite(shift({turn.release[0]: 80.0}, turn))
    assert shift({}, only(scene, "joint_coupling")[0]) is None


def test_an_appendage_that_ends_without_a_peak_is_another_effect(case):
    scene, null, *_ = case
    hypothesis = only(scene, "appendage")[-1]
    session = add_hypotheses(scene.session, hypothesis)
    varies = session.parametrisation
    frequency, damping = (np.array(varies.names) == name for name in hypothesis.valid_below_bound)

    def ends(x):
        ended = Ended(x, varies)
        refit = Refit((hypothesis,), session, ended, null.summary)
        return refit.shows_another_effect

    inside = np.clip(np.zeros(varies.size), varies.lower, varies.upper)
    inside[frequency] -= 0.1
    assert not ends(inside)
    assert ends(np.where(damping, varies.upper, inside))
    assert ends(np.where(frequency, varies.upper, inside))
    assert not ends(np.where(damping, varies.lower, inside))  # a sharp resonance is an appendage


def test_a_cause_has_as_many_parameters_as_its_fit_moves_freely(case):
    scene, null, coupled, _ = case
    assert coupled.count_parameters(coupled.causes[0]) == 3  # stiffness and damping follow others
    link = only(scene, "parallel_path")[0]
    session = add_hypotheses(scene.session, link)
    varies = session.parametrisation
    first = scene.session.parametrisation.size
    x = np.zeros(varies.size)

    def count(values):
        ended = Ended(np.append(x[:first], values), varies)
        refit = Refit((link,), session, ended, null.summary)
        return refit.count_parameters(link)

    strut = np.zeros(12)
    assert count(strut) == 0
    strut[[1, 6, 8, 9]] = 0.3, -0.5, 0.2, 0.1  # a stiffness, its axis, and one way aside
    assert count(strut) == 4
    strut[6] = 1.0  # at its bound
    assert count(strut) == 3
    assert count(np.full(12, 0.01)) == 12
    gain = only(scene, "sensor_gain")[0]
    released = run_refits(scene, [add_cause(null, gain)], SHORT)[0]
    assert released.count_parameters(released.causes[0]) == len(gain.release)
