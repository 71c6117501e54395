"""An answer states true minus drawn, tolerance and effect together."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from truth.campaign.cause import Cause, Wanted
from truth.campaign.draw import (
    REAL_INSTRUMENTS,
    Tolerances,
    draw_basis,
    draw_drawing,
    draw_hammers,
    draw_true,
)
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.protocol import Protocol, occasions, takes
from truth.campaign.tolerance_answer import subtract_drawing
from truth.campaign.virtual_test import Plan, draw_campaign
from truth.effects import CATALOGUE, Scene
from truth.machine.rig import Occasion
from truth.random_streams import stream

SEED = 8


@pytest.fixture(scope="module")
def drawn(two_bodies):
    basis = draw_basis(two_bodies, SEED)
    drawing, true = draw_drawing(basis, SEED), draw_true(basis, Tolerances(), SEED)
    return drawing, true, draw_hammers(drawing, 1, Tolerances(), SEED)


def with_effect(drawn, name, place):
    drawing, true, hammers = drawn
    protocol = Protocol((1,))
    scene = Scene(true, occasions(protocol, takes(protocol, true, SEED)))
    effect = CATALOGUE[name](stream(SEED, "x"), scene, place)
    after = TrueMachine(true, hammers, (effect,)).prepare(Occasion(node=1))
    return effect.answer(), subtract_drawing(effect.answer(), drawing, true, after), after


def test_axes_are_the_drawn_ones_turned_by_the_stated_rotation(drawn):
    alone, answer, after = with_effect(drawn, "sensor_misalignment", "sensor:acc2")
    (sensor,) = (one for _, one in after.station.sensors() if one.node == 2)
    (before,) = (one for _, one in drawn[0].sensors() if one.node == 2)
    turn = Rotation.from_rotvec(answer.parameters["rotation"]).as_matrix()
    np.testing.assert_allclose(sensor.axes, before.axes @ turn.T, atol=1e-12)
    assert answer.parameters["rotation"] != alone.parameters["rotation"]


def test_a_place_is_the_drawn_one_plus_the_stated_offset(drawn):
    _, answer, after = with_effect(drawn, "sensor_position", "sensor:acc3")
    (sensor,) = (one for _, one in after.station.sensors() if one.node == 3)
    (before,) = (one for _, one in drawn[0].sensors() if one.node == 3)
    offset = np.array(answer.parameters["offset"])
    np.testing.assert_allclose(sensor.position, before.position + offset, atol=1e-15)


def test_a_gain_is_that_of_the_reading(drawn):
    alone, answer, after = with_effect(drawn, "sensor_gain", "sensor:acc2")
    (sensor,) = (one for _, one in after.station.sensors() if one.node == 2)
    assert answer.parameters["gain"] == sensor.gain["xyz".index(answer.dof[1])]
    assert answer.parameters["gain"] != alone.parameters["gain"]


def test_a_hit_goes_where_the_stated_rotation_takes_its_axis(drawn):
    _, answer, after = with_effect(drawn, "hammer_misalignment", "hammer:acc1")
    axis = "xyz".index(answer.dof[1])
    turned = Rotation.from_rotvec(answer.parameters["rotation"]).apply(np.eye(3)[axis])
    np.testing.assert_allclose(turned, after.hammers[axis].direction, atol=1e-12)
    assert answer.parameters["rotation"][axis] == pytest.approx(0, abs=1e-15)


def test_the_force_channel_is_off_by_tolerance_and_effect(two_bodies):
    true = draw_true(two_bodies, REAL_INSTRUMENTS, SEED)
    hammers = draw_hammers(two_bodies, 1, REAL_INSTRUMENTS, SEED)
    real = two_bodies, true, hammers
    alone, answer, _ = with_effect(real, "hammer_gain", "hammer:acc1")
    assert answer.parameters["gain"] == pytest.approx(alone.parameters["gain"] * hammers[0].gain)
    alone, answer, _ = with_effect(real, "hammer_delay", "hammer:acc1")
    late = alone.parameters["delay"] + hammers[0].delay
    assert answer.parameters["delay"] == pytest.approx(late)


def test_hits_lie_at_the_stated_offset_on_an_average(drawn):
    drawing, _, hammers = drawn
    alone, answer, after = with_effect(drawn, "hammer_position", "hammer:acc1")
    moved = np.array([hammer.position for hammer in after.hammers])
    before = np.array([hammer.position for hammer in hammers])
    np.testing.assert_allclose(moved - before, np.tile(alone.parameters["offset"], (3, 1)))
    _, point = drawing.aim(1)
    for axis, offset in enumerate(answer.parameters["offset"]):
        felt = [moved[hit, axis] for hit in range(3) if hit != axis]
        assert offset == pytest.approx(np.mean(felt) - point[axis])


def test_a_mass_sits_at_its_place_from_the_drawn_centre(drawn):
    drawing, true, _ = drawn
    alone, answer, _ = with_effect(drawn, "mass_error", "body:holder")
    place = drawing.stages[1].com + answer.parameters["position"]
    np.testing.assert_allclose(place, true.stages[1].com + alone.parameters["position"])
    assert answer.parameters["mass"] == alone.parameters["mass"]


def test_the_campaigns_answer_is_the_stated_one(two_bodies):
    plan = Plan(SEED, Cause((Wanted("sensor_gain", "sensor:acc2"),)), Protocol((1,)))
    answer = tomllib.loads(draw_campaign(two_bodies, plan).answer.decode())
    true = draw_true(draw_basis(two_bodies, SEED), Tolerances(), SEED)
    (sensor,) = (one for _, one in true.sensors() if one.node == 2)
    factor = answer["parameters"]["gain"] / sensor.gain["xyz".index(answer["dof"][1])]
    assert factor > 1.004 or factor < 0.996
