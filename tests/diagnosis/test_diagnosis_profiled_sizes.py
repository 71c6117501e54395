"""Sizes with an interval without their value of no effect: closed forms of the profile."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from diagnosis import EFFECTS
from diagnosis.estimates import size_profile
from diagnosis.estimates.intervals import FittedParameters, fit_parameters
from diagnosis.estimates.profiled_sizes import find_named_size
from diagnosis.estimates.size_profile import find_deviance
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.null_model import fit_null_model
from diagnosis.refits.extended_parametrisation import hold_parameters
from diagnosis.refits.refit import map_values
from diagnosis.refits.refitting import add_hypotheses, find_start
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn

COUNT = 50.0  # independent values
QUANTILE = float(np.sqrt(chi2.ppf(0.95, 1)))


@dataclass(frozen=True)
class Session:
    """Stand-in for a session: the part of it that a refit reads."""

    parametrisation: object


@pytest.fixture
def refits(monkeypatch):
    """Refits of coordinates that are parameters themselves, by the deviance of the held one."""
    refitted_at = []

    def prepare(
        deviance, x=(2.0, 0.5), deviation=(10.0, 1.0), lower=-np.inf, upper=np.inf, alone=None
    ):
        names = tuple("ab"[: len(x)])
        varies = SimpleNamespace(
            names=names,
            parameters=tuple(SimpleNamespace(name=name) for name in names),
            theta=lambda at: at,
            coordinates=lambda theta: theta,
            lower=np.full(len(x), lower),
            is_tolerance=np.zeros(len(x), bool),
            upper=np.full(len(x), upper),
        )
        fitted = np.array(x)
        covariance = np.diag(np.square(deviation))
        confidence = SimpleNamespace(x=fitted, covariance=covariance, deviation=np.array(deviation))

        def run(scene, tasks, schedule):
            (task,) = tasks
            theta, held = task.session.parametrisation
            value = float(theta[names.index(held[0])])
            refitted_at.append((held[0], value))
            gone = deviance(value) if alone is None or len(held) == 1 else alone
            cost = gone / (2 * COUNT)
            return [SimpleNamespace(objective=1.0 + cost, fit=SimpleNamespace(theta=theta))]

        monkeypatch.setattr(size_profile, "run_refits", run)
        monkeypatch.setattr(size_profile, "hold_parameters", lambda _, theta, held: (theta, held))
        refit = SimpleNamespace(
            fit=SimpleNamespace(parametrisation=varies, x=fitted),
            causes=(),
            session=Session(varies),
            floor=0.01,
            objective=1.0,
            summary=SimpleNamespace(count_independent=lambda _: COUNT),
        )
        return refit, FittedParameters(varies, fitted, confidence)

    return prepare, refitted_at


def cause(state=lambda found: {"stiffness": found["a"]}, **more):
    """A hypothesis that states something."""
    return Hypothesis("mine", "body:a", state=state, **{"release": ("a",), **more})


def name_size(case, one):
    return find_named_size(None, *case, one, SETTINGS)


def test_an_interval_without_no_effect_is_left_as_it_is(refits):
    prepare, refitted_at = refits
    case = prepare(lambda _: 0.0, deviation=(0.5, 1.0))
    named = name_size(case, cause())
    assert named.excludes_no_effect
    assert named.intervals["stiffness"] == pytest.approx((2 - 0.5 * QUANTILE, 2 + 0.5 * QUANTILE))
    gain = name_size(prepare(lambda _: 0.0, (0.0,), (0.1,)), cause(lambda found: {"gain": 1.0}))
    assert gain.excludes_no_effect  # nothing stated depends on the coordinates
    assert not refitted_at


def test_where_the_profile_is_a_parabola_its_ends_are_those_of_the_parabola(refits):
    prepare, refitted_at = refits
    sigma = 0.7
    named = name_size(prepare(lambda a: ((a - 2) / sigma) ** 2), cause())
    assert named.excludes_no_effect
    ends = (2 - sigma * QUANTILE, 2 + sigma * QUANTILE)
    assert named.intervals["stiffness"] == pytest.approx(ends, abs=0.15 * sigma)
    assert {name for name, _ in refitted_at} == {"a"}
    assert len(refitted_at) <= 5


def test_a_link_that_may_be_far_stiffer_but_not_absent_is_named_and_a_lost_one_is_not(refits):
    prepare, _ = refits

    def saturate(a):
        """D of a link: it falls by a softer one, and hardly rises by a stiffer one."""
        return 30.0 * (1 / (1 + 4 * a) - 1 / 9) ** 2 / (8 / 9) ** 2 * (1.0 if a < 2 else 60.0)

    named = name_size(prepare(saturate), cause(signed=True))
    low, high = named.intervals["stiffness"]
    assert named.excludes_no_effect
    assert 0 < low < 2 < high
    assert saturate(low) == pytest.approx(chi2.ppf(0.90, 1), abs=0.6)  # of one side: 2.7
    open_ended = name_size(prepare(lambda a: saturate(min(a, 2.0))), cause(signed=True))
    assert open_ended.excludes_no_effect
    assert "stiffness" not in open_ended.intervals  # a number that does not exist is absent
    lost = name_size(prepare(lambda a: 2.5 * (1 - a / 2) ** 2), cause(signed=True))
    assert not lost.excludes_no_effect
    between = prepare(lambda a: 3.0 * (1 - a / 2) ** 2)
    assert name_size(between, cause(signed=True)).excludes_no_effect
    assert not name_size(between, cause()).excludes_no_effect  # it may be negative: 3.84


def test_the_interval_of_a_size_that_cannot_be_negative_ends_at_none(refits):
    prepare, _ = refits
    lost = prepare(lambda _: 0.0, x=(2.0,), deviation=(4.0,), lower=0.0)
    named = name_size(lost, cause())
    assert not named.excludes_no_effect
    assert named.intervals["stiffness"] == pytest.approx((0.0, 2 + 4 * QUANTILE))
    either = name_size(prepare(lambda _: 0.0, x=(2.0,), deviation=(4.0,)), cause())
    assert either.intervals["stiffness"] == pytest.approx((2 - 4 * QUANTILE, 2 + 4 * QUANTILE))


def test_what_states_nothing_without_the_effect_has_no_value_that_an_interval_could_hold(refits):
    prepare, refitted_at = refits
    rigid = cause(lambda found: {"frequency": 100.0 / found["a"]} if found["a"] > 0 else {})
    assert name_size(prepare(lambda _: 0.0, deviation=(0.1, 1.0)), rigid).excludes_no_effect
    assert not refitted_at


def test_every_effect_has_a_state_without_itself(tmp_path):
    session, _ = drawn(tmp_path, 72_012, lines=61, stages=4)
    scene = Scene(session, session.model.drawn)
    for effect in EFFECTS.values():
        for hypothesis in list(effect(scene))[:1]:
            whole = add_hypotheses(session, hypothesis)
            varies = whole.parametrisation
            x = varies.coordinates(find_start(scene, whole, hypothesis))
            is_own = np.isin(np.array(varies.names), hypothesis.coordinates)
            theta = varies.theta(np.where(is_own, 0.0, x))
            assert isinstance(hypothesis.state(map_values(varies, theta)), dict)


def test_a_factor_has_no_effect_at_one_and_of_a_vector_the_largest_component_decides(refits):
    prepare, refitted_at = refits
    factor = cause(lambda found: {"factor": float(np.exp(found["a"]))})
    named = name_size(prepare(lambda a: 4 * (a - 2) ** 2, deviation=(1.5, 1.0)), factor)
    assert named.excludes_no_effect
    assert np.log(named.intervals["factor"]) == pytest.approx(
        (2 - QUANTILE / 2, 2 + QUANTILE / 2), abs=0.1
    )
    refitted_at.clear()
    vector = cause(lambda found: {"stiffness": (None, found["b"], found["a"])}, release=("a", "b"))
    named = name_size(prepare(lambda a: 9 * (a - 2) ** 2, deviation=(9.0, 9.0)), vector)
    assert {name for name, _ in refitted_at} == {"a"}
    nothing, other, largest = named.intervals["stiffness"]
    assert nothing is None
    assert other[0] < 0 < other[1]
    assert largest[0] > 1


def test_a_size_of_coordinates_that_make_up_for_each_other_is_one_unless_all_may_be_gone(refits):
    """Without one of two springs side by side the other is as stiff as both were."""
    prepare, _ = refits
    both = cause(lambda found: {"stiffness": found["a"] + found["b"]}, release=("a", "b"))
    for gone, is_size in ((40.0, True), (1.0, False)):
        case = prepare(lambda a: (a - 2) ** 2 / 9, deviation=(9.0, 9.0), lower=0.0, alone=gone)
        named = name_size(case, both)
        assert named.excludes_no_effect is is_size
        low, high = named.intervals.get("stiffness", (0.0, np.inf))
        assert low <= 2.5 <= high


def test_an_end_beyond_the_bound_of_a_coordinate_is_the_bound(refits):
    prepare, _ = refits
    case = prepare(lambda a: 40 * (1 - min(a, 2) / 2) ** 2, lower=0.0, upper=3.0)
    named = name_size(case, cause(signed=True))
    assert named.intervals["stiffness"][1] == pytest.approx(3.0)
    assert replace(named, intervals={}).excludes_no_effect


def test_where_noise_remains_the_deviance_is_that_of_the_fit_that_states_the_size(tmp_path):
    session, _ = drawn(tmp_path, 72_014, lines=121)
    scene = Scene(session, session.model.drawn)
    refit = fit_null_model(scene, SETTINGS)
    parameters = fit_parameters(refit)
    assert parameters.fit is not refit.fit
    varies, x = parameters.parametrisation, parameters.confidence.x
    deviance_at = find_deviance(scene, refit, parameters, SETTINGS)
    best = int(np.argmin(np.where(varies.is_tolerance, np.inf, parameters.confidence.deviation)))
    for sigmas in (0.0, -2.0, 2.0):
        at = x + sigmas * parameters.confidence.deviation * (np.arange(len(x)) == best)
        held = hold_parameters(varies, varies.theta(at), (varies.names[best],))
        deviance, theta = deviance_at(held, varies.theta(at))
        assert deviance == pytest.approx(sigmas**2, abs=0.1)
        assert varies.coordinates(theta)[best] == pytest.approx(at[best])
