"""Which laws are refitted, and how often: refits are replaced by a list of their results."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.levels import refit_laws as module
from diagnosis.levels.law_alone import LawStart
from diagnosis.levels.law_family import FAMILIES
from diagnosis.settings import SETTINGS
from tests.helpers.nonlinear_joint import JOINT

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
    """Return a function that runs ``refit_laws`` with given starts and results of refits."""

    def run(free, starts, results, rivals=(), remaining=1.0):
        scene = Scene(SimpleNamespace(model=SimpleNamespace(parameters=())), np.zeros(0))
        pending = {effect: iter(values) for effect, values in results.items()}

        def take(law, refit, about):
            del about
            law.count += 1
            if law.count == 2 or refit.objective < law.objective:
                law.refit = refit

        def refit_all(scene, tasks, schedule):
            del scene, schedule
            if tasks == ["free"]:
                return [free]
            return [next(pending[task], Result(0.0)) for task in tasks]

        monkeypatch.setattr(module, "add_cause", lambda *_: "free")
        monkeypatch.setattr(module, "free_each_level", lambda *_: None)
        monkeypatch.setattr(module, "_read_values", lambda *_: np.zeros(0))
        monkeypatch.setattr(module, "_find_starts", lambda *_: starts)
        monkeypatch.setattr(module, "_build_task", lambda _, law: law.start.family.effect)
        monkeypatch.setattr(module, "run_refits", refit_all)
        monkeypatch.setattr(module._FittedLaw, "take", take)
        null, current = (
            SimpleNamespace(
                **vars(NULL),
                fit=SimpleNamespace(theta=np.zeros(0)),
                summary=SimpleNamespace(cost=-10.0, level_excess=excess),
            )
            for excess in (1.0, remaining)
        )
        hypotheses = [Hypothesis(effect, "joint:block", "tz", spring=JOINT) for effect in EFFECTS]
        settings = replace(SETTINGS, min_closed=0.2)
        refits = module.refit_laws(scene, null, current, hypotheses, rivals, settings)
        return sorted(refit.objective for refit in refits)

    return run


def start_at(effect, cost, floor):
    family = FAMILIES[effect][0]
    theta = tuple(np.ones(len(family.parameters)))
    return LawStart(JOINT, family, theta, np.ones(2), cost, floor)


def test_laws_are_compared_once_all_were_refitted_twice(refit_with):
    starts = [start_at("backlash", -11.0, 0.05), start_at("hardening", -11.2, 0.05)]
    results = {
        "backlash": [Result(-11.5), Result(-13.0), Result(-13.5)],
        "hardening": [Result(-12.0), Result(-12.1), Result(-20.0)],
    }
    assert refit_with(Result(-11.0), starts, results) == [-13.5, -12.1]


def test_a_law_is_refitted_where_free_levels_explain_little(refit_with):
    starts = [start_at("backlash", -11.0, 0.05)]
    free = Result(-10.01, floor=0.099, gap=95.0)
    assert refit_with(free, starts, {"backlash": [Result(-12.0), Result(-12.1)]}) == [-12.1]


@pytest.mark.parametrize(
    ("rivals", "remaining"),
    [
        ((), 0.1),  # other causes explain what depends on the level
        ((Result(-13.0),), 1.0),  # a linear cause gains far more
    ],
)
def test_a_law_that_promises_little_is_not_refitted(refit_with, rivals, remaining):
    free, start = Result(-10.01, floor=0.099), start_at("backlash", -11.0, 0.05)
    results = {"backlash": [Result(-12.0)]}
    assert refit_with(free, [start], results, rivals, remaining) == []


def test_a_loose_gap_that_is_far_behind_is_refitted_once(refit_with):
    loose = replace(start_at("backlash", -7.0, 0.2), is_loose=True)
    starts, free = [start_at("hardening", -11.2, 0.05), loose], Result(-11.0)
    behind = {"backlash": [Result(-10.0), Result(-20.0)], "hardening": [Result(-12.0)] * 3}
    assert refit_with(free, starts, behind) == [-12.0, -10.0]
    better = {"backlash": [Result(-13.0), Result(-20.0)], "hardening": [Result(-12.0)] * 3}
    assert refit_with(free, starts, better) == [-20.0, -12.0]


def test_a_refit_that_ends_higher_is_followed_by_another(monkeypatch):
    monkeypatch.setattr(module, "_read_values", lambda *_: np.zeros(0))
    monkeypatch.setattr(module, "_read_start", lambda _, start: start)
    monkeypatch.setattr(module, "map_values", lambda *_: {})
    scene = Scene(SimpleNamespace(model=SimpleNamespace(parameters=())), np.zeros(0))
    objectives = [-1.0, -2.0, -3.0, -2.5, -3.5, -3.5005]
    law = module._FittedLaw(start_at("backlash", -1.0, 0.1), scene, 0.1)
    settled = []
    for objective in objectives:
        fit = SimpleNamespace(parametrisation=None, theta=None)
        causes = (SimpleNamespace(believed={}),)
        fields = {"objective": objective, "gap": 50.0, "floor": 0.1, "fit": fit, "causes": causes}
        law.take(SimpleNamespace(**fields), scene)
        settled.append(law.is_settled)
    assert settled == [False] * 5 + [True]
    assert law.objective == objectives[-1]
    law.take(SimpleNamespace(**{**fields, "objective": -3.0}), scene)
    law.take(SimpleNamespace(**{**fields, "objective": -3.1}), scene)
    assert law.is_settled
