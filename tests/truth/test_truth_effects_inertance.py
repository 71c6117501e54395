"""Inertance against closed forms: mass that the relative motion of two bodies alone feels."""

from dataclasses import replace

import numpy as np
import pytest
from effect_rigs import FREQ, OCCASIONS, chain, frf_of, random_of, rig_of, scene_of

from truth.effects.joint_errors import Inertance, draw_inertance
from truth.effects.places import StageDirection
from truth.errors import TruthError
from truth.machine.station import GROUND

S = 2j * np.pi * FREQ
TZ = StageDirection("table", 2, "tz")


def vertical(one_body, effect):
    occasions = tuple(replace(occasion, node=3) for occasion in OCCASIONS)
    return frf_of(one_body, effect, occasions=occasions)[:, 2, 2]


def test_an_inertance_is_mass_that_only_relative_motion_feels(one_body, two_bodies):
    effect = Inertance(TZ, 120.0, size=0.3)
    joint = one_body.stages[0].joints[2]
    expected = S**2 / ((120 + 36) * S**2 + joint.damping * S + joint.stiffness)
    np.testing.assert_allclose(vertical(one_body, effect), expected, rtol=1e-10)
    assert effect.answer().parameters == {"inertance": pytest.approx(36.0)}
    between = Inertance(StageDirection("holder", 2, "tz"), 40.0, size=0.3)
    added = rig_of(two_bodies, [between]).equations.mass - rig_of(two_bodies).equations.mass
    together = np.tile([0.0, 0, 1, 0, 0, 0], 2)
    np.testing.assert_allclose(added @ together, 0, atol=1e-12)
    apart = np.array([0.0] * 8 + [1.0] + [0.0] * 3)
    assert apart @ added @ apart == pytest.approx(12.0)


def test_an_inertance_is_measured_by_the_mass_or_moment_that_it_joins():
    stage = chain().stages[1]
    for seed in range(30):
        effect = draw_inertance(random_of(seed), scene_of(chain()), "joint:arm")
        axis = "xyz".index(effect.direction.dof[1])
        moment = stage.inertia[axis, axis]
        expected = stage.mass if effect.direction.dof[0] == "t" else moment
        assert effect.reference == pytest.approx(expected)


def test_no_inertance_stands_on_the_floor_where_it_is_a_mass():
    station = chain()
    floor = {stage.name for stage in station.stages if stage.parent == GROUND}
    drawn = {
        draw_inertance(random_of(k), scene_of(station), None).direction.stage for k in range(40)
    }
    assert drawn == {stage.name for stage in station.stages} - floor
    (only,) = floor
    with pytest.raises(TruthError):
        draw_inertance(random_of(1), scene_of(station), f"joint:{only}")
