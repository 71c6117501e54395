"""Smallest sizes: refits in closed form against least squares, and what the posterior names."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from diagnosis.next_test import smallest_sizes
from diagnosis.next_test.drawn_effects import DrawnEffects, propose_linear
from diagnosis.next_test.further_gains import compare_sizes, rank_gains
from diagnosis.next_test.linear_search import LinearSearch
from diagnosis.next_test.predicted_verdict import PredictedVerdict
from diagnosis.next_test.smallest_sizes import SmallestSize, predict_smallest_sizes
from diagnosis.search.linearised_fit import find_signed
from identification.words import TOLERANCE_BOUND_SIGMA
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene

EFFECTS = ("mass_error", "sensor_gain", "sensor_position", "sensor_polarity", "joint_coupling")


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return drawn(tmp_path_factory.mktemp("drawn"), 72_051, "none", lines=81)[0]


@pytest.fixture(scope="module")
def prediction(session):
    scene = smallest_sizes._set_scene(session, early_scene(session).settings)
    hypotheses = [h for h in propose_linear(scene) if h.effect in EFFECTS]
    linear = LinearSearch.linearise(scene, hypotheses)
    return smallest_sizes._Prediction(
        scene, linear, DrawnEffects(scene, linear), PredictedVerdict(scene, linear)
    )


def solve(linear, moved, hypothesis):
    """Return data cost and prior of a bounded fit by stacked least squares."""
    varies, normal = linear.varies, linear.normal
    count = varies.size
    chosen = [] if hypothesis is None else linear.find_coordinates(hypothesis)
    values, vectors = np.linalg.eigh(normal)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    columns = np.hstack([root[:, :count], root[:, chosen]])
    prior = np.hstack([np.diag(np.sqrt(varies.precision)), np.zeros((count, len(chosen)))])
    signed = np.zeros(0, bool) if hypothesis is None else find_signed(hypothesis)
    lower = np.append(varies.lower, np.where(signed, 0.0, -np.inf))
    upper = np.append(varies.upper, np.full(len(chosen), np.inf))
    goal = np.append(root @ moved, np.zeros(count))
    scale = np.linalg.norm(np.vstack([columns, prior]), axis=0)
    fit = lsq_linear(
        np.vstack([columns, prior]) / scale, goal, (lower * scale, upper * scale), method="bvls"
    )
    x = fit.x / scale
    data = root @ moved - columns @ x
    return data @ data / 2, x[:count] @ (varies.precision * x[:count]) / 2


@pytest.mark.parametrize("effect", ["mass_error", "sensor_position", "joint_coupling"])
def test_a_refit_in_closed_form_is_bounded_least_squares(prediction, effect, monkeypatch):
    # Outliers by chance have bounds of their own, which least squares do not know.
    monkeypatch.setattr("diagnosis.next_test.linear_search.widen_outliers", lambda *_: None)
    linear = prediction.linear
    rivals = [h for h in linear.hypotheses if h.effect == effect]
    drawn_effect = prediction.effects.draw(rivals[:1])[0]
    for size in (3.0, 300.0):
        moved = size * drawn_effect.moved
        for hypothesis in (None, rivals[-1]):
            refit = linear.refit(moved, hypothesis)
            gap, prior = solve(linear, moved, hypothesis)
            assert refit.cost == pytest.approx(gap + prior, rel=1e-3, abs=1e-3)
            assert linear.varies.coordinates_within_bounds(refit.x).all()
    # The larger size pulls tolerances to their bounds.
    assert linear.varies.coordinates_at_bound(linear.refit(moved).x).any()


def test_an_effect_leaves_nothing_in_a_fit_that_knows_it(prediction):
    for hypothesis in prediction.linear.hypotheses[::7]:
        for effect in prediction.effects.draw([hypothesis])[:1]:
            refit = prediction.linear.refit(20 * effect.moved, hypothesis)
            if effect.is_sized:
                assert refit.cost < 1e-3 * prediction.linear.refit(20 * effect.moved).cost + 1e-6


def test_the_size_is_halved_in_to_the_one_that_the_posterior_names(prediction):
    shapes = [h for h in prediction.linear.hypotheses if h.effect == "joint_coupling"]
    effect = prediction.effects.draw(shapes[:1])[0]
    size = prediction._find_threshold(effect)
    rivals = prediction.verdict.rank_rivals(effect, size)
    assert prediction.verdict.is_named(effect, 1.1 * size, rivals)
    assert not prediction.verdict.is_named(effect, 0.9 * size, rivals)


def test_a_twin_is_never_found(prediction):
    gain = next(h for h in prediction.linear.hypotheses if h.effect == "sensor_gain")
    twin = replace(gain, effect="twin")
    linear = replace(prediction.linear, hypotheses=(gain, twin))
    verdict = replace(prediction.verdict, linear=linear)
    (row,) = replace(prediction, linear=linear, verdict=verdict).predict([gain])
    assert not row.is_found
    assert row.confused == (f"twin@{gain.location}",)


def test_every_effect_at_every_place_has_a_size_by_a_parameter_of_the_verdict(session):
    rows = predict_smallest_sizes(session, EFFECTS)
    assert {row.effect for row in rows} == set(EFFECTS)
    parameters = {"mass_error": "mass", "joint_coupling": "offset", "sensor_position": "offset"}
    for row in rows:
        if row.effect == "sensor_polarity":
            assert (row.is_found, row.value) == (True, None)  # there or not
        elif row.is_found:
            assert row.parameter == parameters.get(row.effect, "gain")
            assert row.value > 0
    # Beyond what tolerances may be by chance.
    tolerance = session.campaign.tolerance
    gains = [abs(row.value - 1) for row in rows if row.effect == "sensor_gain"]
    assert min(gains) > 4.5 * tolerance.sensor_gain
    offsets = [row.value for row in rows if row.effect == "sensor_position"]
    assert min(offsets) > TOLERANCE_BOUND_SIGMA * tolerance.sensor_position
    masses = [row for row in rows if row.effect == "mass_error"]
    assert predict_smallest_sizes(session, ("mass_error",), (masses[0].location,)) == masses[:1]


def row(effect, of_usual, location="body:a", *, is_found=True):
    value = None if of_usual is None else 10 * of_usual
    return SmallestSize(effect, location, "", "mass", value, of_usual, is_found, 1.0, ())


def test_a_gain_counts_what_is_found_before_and_after():
    before = [row("a", 2.0), row("b", 0.5), row("c", None, is_found=False), row("d", 0.9)]
    after = [row("a", 0.8), row("b", 0.25), row("c", 0.6), row("e", 0.1)]
    gain = compare_sizes("more", before, after)
    assert (gain.findable_before, gain.findable, gain.compared) == (1, 3, 3)
    assert gain.shrink == pytest.approx(np.sqrt(0.4 * 0.5))
    assert gain.most.effect == "c"  # not found at all before
    assert gain.most_after.value == pytest.approx(6.0)


def test_tests_are_ranked_by_what_they_find_and_then_by_sizes():
    before = [row("a", 2.0), row("b", 0.5)]
    findable, small, large = (
        compare_sizes(name, before, after)
        for name, after in (
            ("found", [row("a", 0.9), row("b", 0.5)]),
            ("small", [row("a", 1.1), row("b", 0.1)]),
            ("large", [row("a", 1.9), row("b", 0.4)]),
        )
    )
    assert [gain.name for gain in rank_gains([large, small, findable])] == [
        "found",
        "small",
        "large",
    ]
