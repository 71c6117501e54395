"""Which laws are refitted, and how often: refits are replaced by a list of their results."""

from dataclasses import dataclass, replace
from itertools import chain, count, repeat
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.levels import fitted_law
from diagnosis.levels import refit_laws as module
from diagnosis.levels.law_alone import LawStart
from diagnosis.levels.law_family import FAMILIES
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.settings import SETTINGS
from tests.helpers.nonlinear_joint import JOINT
from tuning.misfit.residual_statistics import ModelError

EFFECTS = ("backlash", "hardening")
NULL = SimpleNamespace(objective=-10.0, floor=0.1, gap=100.0, session=None, causes=())


@dataclass(frozen=True)
class Result:
    """Result of a refit: its objective, model-error floor and gap."""

    objective: float
    floor: float = 0.03
    gap: float = 50.0

    @property
    def summary(self):
        return SimpleNamespace(cost=self.objective)


@pytest.fixture
def refit_with(monkeypatch):
    """Return a function that runs ``refit_laws`` with given starts and objectives of each turn.

    It returns the last refit of each law, and how many simulations there were.
    """

    def run(free, starts, results, rivals=(), remaining=1.0):
        scene = Scene(SimpleNamespace(model=SimpleNamespace(parameters=())), np.zeros(0))
        scene = replace(
            scene, session=SimpleNamespace(campaign=SimpleNamespace(freq_hz=range(800)))
        )
        pending = {effect: iter(values) for effect, values in results.items()}
        simulated = []

        def linearise(law, current, table, stride):
            del current, table, stride
            law.objective = min(law.objective, next(pending[law.point.start.family.effect]))
            law.task = law.objective

        def refit_all(scene, tasks, schedule):
            del scene, schedule
            return [free if task == "free" else Result(task) for task in tasks]

        def simulate_all(calls, jobs):
            del jobs
            simulated.extend(calls)
            return [None] * len(calls)

        monkeypatch.setattr(module, "add_cause", lambda *_: "free")
        monkeypatch.setattr(module, "free_each_level", lambda *_: None)
        monkeypatch.setattr(module, "read_values", lambda *_: np.zeros(0))
        monkeypatch.setattr(module, "_find_starts", lambda *_: starts)
        monkeypatch.setattr(module, "run_refits", refit_all)
        monkeypatch.setattr(module, "run_in_parallel", simulate_all)
        monkeypatch.setattr(fitted_law.LawPoint, "plan", lambda _: ())
        monkeypatch.setattr(fitted_law.FittedLaw, "linearise", linearise)
        monkeypatch.setattr(
            fitted_law.FittedLaw, "take", lambda law, refit, _: setattr(law, "refit", refit)
        )
        null, current = (
            SimpleNamespace(
                **{**vars(NULL), "session": scene.session},
                fit=SimpleNamespace(theta=np.zeros(0)),
                summary=SimpleNamespace(cost=-10.0, level_excess=excess),
            )
            for excess in (1.0, remaining)
        )
        hypotheses = [Hypothesis(effect, "joint:block", "tz", spring=JOINT) for effect in EFFECTS]
        settings = replace(SETTINGS, min_closed=0.2)
        refits = module.refit_laws(scene, null, current, hypotheses, rivals, settings)
        return sorted(refit.objective for refit in refits), len(simulated)

    return run


def start_at(effect, cost, floor):
    family = FAMILIES[effect][0]
    theta = tuple(np.ones(len(family.parameters)))
    return LawStart(JOINT, family, theta, np.ones(2), cost, floor)


def test_a_search_for_laws_ends_however_much_each_turn_gains(refit_with):
    starts = [start_at("backlash", -11.0, 0.05), start_at("hardening", -11.2, 0.05)]
    falling = {effect: (-11.0 - turn for turn in count()) for effect in EFFECTS}
    objectives, simulated = refit_with(Result(-11.0), starts, falling)
    turns = LEVEL_SETTINGS.max_turns
    assert objectives == [-10.0 - turns, -10.0 - turns]
    assert simulated == 2 * turns


@pytest.mark.parametrize(("behind", "turns"), [(0.7, 2), (0.3, LEVEL_SETTINGS.max_turns // 3 + 1)])
def test_a_law_that_stays_behind_goes_no_further(refit_with, behind, turns):
    starts = [start_at("backlash", -11.0, 0.05), start_at("hardening", -11.2, 0.05)]
    late = {"backlash": chain([-13.0] * turns, repeat(-20.0)), "hardening": repeat(-13.0 - behind)}
    objectives, simulated = refit_with(Result(-11.0), starts, late)
    assert objectives == [-13.0 - behind, -13.0]
    assert simulated == turns + LEVEL_SETTINGS.max_turns


def test_a_law_is_refitted_where_free_levels_explain_little(refit_with):
    starts = [start_at("backlash", -11.0, 0.05)]
    free = Result(-10.01, floor=0.099, gap=95.0)
    assert refit_with(free, starts, {"backlash": repeat(-12.0)})[0] == [-12.0]


@pytest.mark.parametrize(
    ("rivals", "remaining"),
    [
        ((), 0.1),  # other causes explain what depends on the level
        ((Result(-13.0),), 1.0),  # a linear cause gains far more
    ],
)
def test_a_law_that_promises_little_is_not_refitted(refit_with, rivals, remaining):
    free, start = Result(-10.01, floor=0.099), start_at("backlash", -11.0, 0.05)
    results = {"backlash": repeat(-12.0)}
    assert refit_with(free, [start], results, rivals, remaining) == ([], 0)


@pytest.fixture
def law(monkeypatch):
    """A law whose simulations show given costs: ``simulate`` returns the radius of its task."""
    scene = Scene(SimpleNamespace(model=SimpleNamespace(parameters=())), np.zeros(0))
    law = fitted_law.FittedLaw(fitted_law.LawPoint(start_at("backlash", -1.0, 0.1), scene))

    @dataclass(frozen=True)
    class Task:
        point: object
        radius: float
        floor: float = 0.1

    def simulate(cost):
        error = None if cost is None else ModelError(0.1, cost, 1)
        monkeypatch.setattr(fitted_law, "estimate_start_error", lambda *_: error)
        law.linearise(None, None, 4)
        return law.task

    def refit_to(objective):
        causes = (SimpleNamespace(believed={}),)
        fit, summary = SimpleNamespace(parametrisation=None, theta=None), Result(objective).summary
        fields = {"objective": objective, "gap": 50.0, "fit": fit, "summary": summary}
        law.take(SimpleNamespace(**fields, causes=causes), scene)

    monkeypatch.setattr(fitted_law, "_build_task", lambda _, point, __, radius: Task(point, radius))
    monkeypatch.setattr(fitted_law, "read_values", lambda *_: np.zeros(0))
    monkeypatch.setattr(fitted_law, "_read_start", lambda _, start: replace(start))
    monkeypatch.setattr(fitted_law, "map_values", lambda *_: {})
    law.simulate, law.refit_to = simulate, refit_to
    return law


def test_a_law_that_explains_less_is_left_for_the_best_one_in_a_smaller_region(law):
    first = law.simulate(-1.0)
    law.refit_to(-2.0)
    second = law.simulate(-1.9)
    assert second.point is not first.point
    assert second.radius > first.radius  # the turn kept its promise
    law.refit_to(-3.0)
    third = law.simulate(-1.5)
    assert third.point is second.point
    assert third.radius < first.radius
    assert law.objective == -1.9
    assert not law.is_settled


def test_a_law_settles_where_a_turn_promises_nothing_or_no_step_is_short_enough(law):
    law.simulate(-1.0)
    law.refit_to(-1.000005)
    assert law.is_settled
    law.is_settled = False
    for _ in range(3):
        law.simulate(-0.5)
        law.refit_to(-2.0)
    assert law.is_settled
    assert law.objective == -1.0


def test_a_law_whose_motion_grows_without_bound_is_left_out(law):
    assert law.simulate(None) is None
    assert law.is_settled
