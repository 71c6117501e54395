"""Drift between the levels of a test: the joint of each visit, and when visits are counted."""

from dataclasses import replace

import numpy as np
import pytest
from effect_rigs import OCCASIONS, chain, frf_of, random_of, scene_of

from truth.campaign.protocol import Protocol, occasions, takes
from truth.effects import RIVALS, Scene
from truth.effects.drift import LevelDrift, draw_level_drift


def visit_of(number):
    return tuple(replace(one, visit=number) for one in OCCASIONS)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_joint_differs_from_visit_to_visit(sign):
    station = chain()
    effect = LevelDrift(stage="arm", visits=3, sign=sign, size=0.2)
    for visit in range(3):
        factor = np.exp(sign * 0.1 * visit)
        joints = tuple(
            replace(one, stiffness=factor * one.stiffness) for one in station.stages[1].joints
        )
        warm = replace(station.stages[1], joints=joints)
        expected = frf_of(replace(station, stages=(station.stages[0], warm, station.stages[2])))
        found = frf_of(station, effect, occasions=visit_of(visit))
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert effect.answer().parameters == {
        "factor_2": pytest.approx(np.exp(sign * 0.1)),
        "factor_3": pytest.approx(np.exp(sign * 0.2)),
    }


def test_a_level_that_returns_is_a_visit_of_its_own():
    protocol = Protocol(nodes=(1,), levels=(40.0, 200.0, 40.0))
    found = occasions(protocol, takes(protocol, chain(), 1))
    assert [one.visit for one in found] == [0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_drift_needs_two_visits():
    assert draw_level_drift(random_of(1), scene_of(chain()), None) is None
    scene = Scene(chain(), (*visit_of(0), *visit_of(1)))
    drawn = RIVALS["level_drift"](random_of(1), scene, "joint:arm")
    assert (drawn.stage, drawn.visits) == ("arm", 2)
    assert drawn.answer().dof == "levels"
