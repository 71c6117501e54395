"""Intervals of what is stated: drawn answers are inside, and none is said of what is not known."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.estimates.intervals import FittedParameters, fit_parameters
from diagnosis.hypothesis import Hypothesis
from diagnosis.stated_values import Vague
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, propose_at, refit_null, refit_with

QUANTILE = 1.959964


def worth(x, covariance, lower=-np.inf, upper=np.inf):
    """Of coordinates a, b, .. that are parameters themselves."""
    x = np.array(x, float)
    names = tuple("abcdef"[: len(x)])
    parametrisation = SimpleNamespace(
        names=names,
        parameters=tuple(SimpleNamespace(name=name) for name in names),
        theta=lambda at: at,
        lower=np.full(len(x), lower),
        upper=np.full(len(x), upper),
    )
    covariance = np.array(covariance, float)
    sure = SimpleNamespace(x=x, covariance=covariance, deviation=np.sqrt(np.diag(covariance)))
    return FittedParameters(parametrisation, x, sure)


def stating(state):
    """A hypothesis that states something."""
    return Hypothesis("mine", "body:a", state=state)


@pytest.mark.parametrize(("effect", "seed"), [("parallel_path", 73_504), ("support_loss", 73_503)])
def test_what_was_drawn_lies_in_the_interval(effect, seed, tmp_path):
    session, text = drawn(tmp_path, seed, effect, lines=161)
    answer = tomllib.loads(text)
    scene = early_scene(session)
    one = propose_at(scene, effect, answer["location"])[0]
    null = refit_null(scene)
    sure = fit_parameters(refit_with(scene, null, one))
    intervals = sure.estimate_intervals(one)
    assert set(intervals) >= set(answer["parameters"])
    for name, ends in ((name, intervals[name]) for name in answer["parameters"]):
        true, said = (
            np.array(of[name]) for of in (answer["parameters"], sure.state_parameters(one))
        )
        low, high = np.array(ends).T
        assert (low <= true).all()
        assert (true <= high).all()
        assert (low <= said).all()
        assert (said <= high).all()
        widest = 1.0 if name == "damping" else 0.3
        assert (high - low < widest * np.abs(true).max()).all()
        if effect == "support_loss":
            assert (low >= 0).all()
            assert (high <= 1).all()


def test_of_what_is_linear_it_is_that_of_the_covariance():
    random = np.random.default_rng(1)
    root, rows = random.standard_normal((3, 3)), random.standard_normal((2, 3))
    at = worth([0.3, -0.2, 5.0], root @ root.T)
    names = at.parametrisation.names
    one = stating(lambda found: {"both": tuple(rows @ [found[name] for name in names])})
    low, high = np.array(at.estimate_intervals(one)["both"]).T
    spread = QUANTILE * np.sqrt(np.diag(rows @ root @ root.T @ rows.T))
    np.testing.assert_allclose((high - low) / 2, spread, rtol=1e-6)
    np.testing.assert_allclose((high + low) / 2, rows @ at.theta, rtol=1e-6, atol=1e-9)


def test_what_changes_nothing_stated_does_not_widen_it():
    # a / b does not feel both grow alike, of which nothing is known: the covariance's direction x.
    x, across = np.array([0.5, 1.0]), np.array([1.0, -0.5])
    at = worth(x, 100 * np.outer(x, x) + 1e-4 * np.outer(across, across))
    one = stating(lambda found: {"share": found["a"] / found["b"]})
    low, high = at.estimate_intervals(one)["share"]
    half = QUANTILE * 0.01 * (1.0 + 0.5 * 0.5)  # d(a / b) along across
    assert (low, high) == pytest.approx((0.5 - half, 0.5 + half), abs=0.05 * half)  # it bends


@pytest.mark.parametrize("deviation", [0.1, 100.0])
def test_what_shapes_an_effect_ends_where_fits_may_reach_and_sizes_do_not(deviation):
    # Else ends are where a logarithm is hundreds of units off: at 1e-38 and 1e40 N s/m.
    at = worth([9.0, -1.5], np.diag([1.0, deviation**2]), lower=[0.0, -2.0], upper=[10.0, 2.0])
    one = replace(
        stating(lambda found: {"size": found["a"], "time": float(np.exp(found["b"]))}),
        scored=("a",),
    )
    either = QUANTILE * np.array([-1, 1])
    found = at.estimate_intervals(one)
    assert found["size"] == pytest.approx(9.0 + either, rel=1e-6)
    ends = np.exp(np.clip(-1.5 + deviation * either, -2.0, 2.0))
    assert found["time"] == pytest.approx(ends, rel=1e-6)


@pytest.mark.parametrize("equal", [(0, 1), (0, 1, 2), ()])
def test_the_largest_of_several_has_an_interval_where_others_may_be_larger(equal):
    x = np.array([1.0, 0.99, 0.98, 0.1])
    x[list(equal)] = 1.0
    at = worth(x, 0.02**2 * np.eye(4) + 9.0 * np.outer(x, x), lower=0.0, upper=1.0)
    names = at.parametrisation.names

    def state(found):
        carried = np.maximum([found[name] for name in names], 0.0)
        return {"fraction": tuple((carried / carried.max()).tolist())}

    low, high = np.array(at.estimate_intervals(stating(state))["fraction"]).T
    assert (low[:3] > 0.85).all()
    assert (low[:3] < 0.99).all()
    assert (high[:3] > 0.999).all()
    assert (high <= 1).all()
    assert 0.03 < low[3] < 0.07
    assert 0.13 < high[3] < 0.17


@pytest.mark.parametrize(("mass", "said"), [(5.0, {"mass", "position"}), (1.5, {"mass"})])
def test_where_a_mass_may_be_nothing_its_place_has_no_interval(mass, said):
    at = worth([mass, 0.5], np.eye(2) * [1.0, 0.01])
    one = stating(lambda found: {"mass": found["a"], "position": (found["b"] / found["a"], 0.0)})
    assert set(at.estimate_intervals(one)) == said


def test_a_vector_of_which_a_component_is_a_convention_has_none():
    at = worth([1.0, 2.0], np.eye(2))
    assert at.estimate_intervals(stating(lambda found: {"place": (0.0, found["a"])}))
    assert not at.estimate_intervals(stating(lambda found: {"place": Vague((0.0, found["a"]))}))
    assert not at.estimate_intervals(stating(lambda _: {}))
