"""Effects against textbook formulas."""

from dataclasses import replace

import numpy as np
import pytest

from truth.campaign.machine_on_test import TrueMachine
from truth.effects import CATALOGUE, Scene
from truth.effects.body_errors import Appendage
from truth.errors import TruthError
from truth.machine.rig import Occasion, Prepared, accelerance, build
from truth.random_streams import stream

FREQ = np.linspace(0.5, 200, 400)
W = 2 * np.pi * FREQ
SIX = {"body_mass": 120.0, "size": 0.05, "damping": 0.02}  # 6 kg


def frf(station, hammers, effect):
    return accelerance(TrueMachine(station, hammers, (effect,)).rig(Occasion()), FREQ)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_appendage_is_the_tuned_mass_damper_of_the_textbook(one_body, hammers_at, axis):
    # Den Hartog 1956, ch. 3: x1/f = (k2 - m2 w^2 + i w c2) / determinant of the 2 x 2 system.
    stage = one_body.stages[0]
    effect = Appendage(body="table", axis=axis, frequency=30.0, **SIX)
    w2 = 2 * np.pi * 30.0
    s1 = stage.joints[axis].stiffness + 1j * W * stage.joints[axis].damping
    s2 = 6.0 * w2**2 + 1j * W * 2 * 0.02 * 6.0 * w2
    Z11, Z22 = s1 + s2 - stage.mass * W**2, s2 - 6.0 * W**2
    expected = -(W**2) * Z22 / (Z11 * Z22 - s2**2)
    hammers = hammers_at(0, stage.com)
    H = frf(one_body, hammers, effect)
    np.testing.assert_allclose(H[:, axis, axis], expected, rtol=1e-10)
    plain = accelerance(build(Prepared(one_body, hammers)), FREQ)
    for other in {0, 1, 2} - {axis}:
        np.testing.assert_allclose(H[:, other, other], plain[:, other, other], rtol=1e-12)


@pytest.mark.parametrize("counted", [0.0, 1.0])
def test_a_box_on_flexures_adds_its_mass_across_its_axis(one_body, hammers_at, counted):
    # Along the axis m R(s); across it m s^2; less m s^2 in all axes that the body holds already.
    stage = one_body.stages[0]
    effect = Appendage("table", axis=0, frequency=30.0, across=1.0, counted=counted, **SIX)
    w2 = 2 * np.pi * 30.0
    spring = w2**2 + 2j * W * 0.02 * w2
    felt = np.array([spring / (spring - W**2), 1.0 + 0 * W, 1.0 + 0 * W]).T - counted
    H = frf(one_body, hammers_at(0, stage.com), effect)
    for axis, joint in enumerate(stage.joints[:3]):
        Z = joint.stiffness + 1j * W * joint.damping - W**2 * (stage.mass + 6.0 * felt[:, axis])
        np.testing.assert_allclose(H[:, axis, axis], -(W**2) / Z, rtol=1e-10)


def test_an_appendage_lets_the_rigid_directions_be(two_bodies, hammers_at):
    lower, upper = two_bodies.stages
    station = replace(two_bodies, stages=(lower, replace(upper, joints=upper.joints[:3])))
    effect = Appendage(body="holder", axis=2, frequency=60.0, **SIX)
    hammers = hammers_at(1, upper.com)
    rigid = TrueMachine(station, hammers, (effect,)).rig(Occasion()).equations.rigid
    assert rigid.shape == (3, 13)
    assert not rigid[:, -1].any()
    plain = accelerance(build(Prepared(station, hammers)), FREQ)
    H = frf(station, hammers, effect)
    assert np.abs(H - plain).max() > 1e-3 * np.abs(plain).max()


def test_a_very_soft_appendage_is_not_felt(one_body, hammers_at):
    effect = Appendage(body="table", axis=1, frequency=1e-4, **SIX)
    hammers = hammers_at(0, one_body.stages[0].com)
    H = frf(one_body, hammers, effect)
    plain = accelerance(build(Prepared(one_body, hammers)), FREQ)
    np.testing.assert_allclose(H, plain, rtol=1e-6, atol=1e-12)


def test_drawn_appendages_keep_to_their_ranges_and_go_everywhere(nominal):
    masses = {stage.name: stage.mass for stage in nominal.stages}
    drawn = [
        CATALOGUE["appendage"](stream(s, "x"), Scene(nominal, ()), None).answer()
        for s in range(200)
    ]
    assert {one.location for one in drawn} == {f"body:{name}" for name in masses}
    assert {one.dof for one in drawn} == {"tx", "ty", "tz"}
    for one in drawn:
        ratio = one.parameters["mass"] / masses[one.location.removeprefix("body:")]
        assert 0.03 <= ratio <= 0.1
        assert 30 <= one.parameters["frequency"] <= 150
        assert 0.01 <= one.parameters["damping"] <= 0.03


def test_naming_the_body_leaves_the_other_draws_alone(nominal):
    free = CATALOGUE["appendage"](stream(8, "x"), Scene(nominal, ()), None).answer()
    named = CATALOGUE["appendage"](stream(8, "x"), Scene(nominal, ()), "body:spindle").answer()
    assert named.location == "body:spindle"
    assert named.dof == free.dof
    assert named.parameters["frequency"] == free.parameters["frequency"]


def test_no_effect_changes_nothing_and_has_no_place(nominal):
    effect = CATALOGUE["none"](stream(1, "x"), Scene(nominal, ()), None)
    tested = Prepared(nominal, ())
    assert effect.to_machine(tested, Occasion()) is tested
    assert effect.answer().effect == "none"
    assert not effect.answer().parameters
    with pytest.raises(TruthError, match="leave it out"):
        CATALOGUE["none"](stream(1, "x"), Scene(nominal, ()), "body:ty")


def test_an_unknown_body_is_refused_with_the_names_that_exist(nominal):
    with pytest.raises(TruthError, match=r"'lid' is unknown.*granite_bottom.*hexapod"):
        CATALOGUE["appendage"](stream(1, "x"), Scene(nominal, ()), "body:lid")


@pytest.mark.parametrize("wrong", [{"size": 0.0}, {"frequency": -1.0}, {"axis": 3}])
def test_an_appendage_that_cannot_exist_is_refused(wrong):
    parameters = {"axis": 0, "frequency": 50.0, **SIX} | wrong
    with pytest.raises(TruthError, match="no sense"):
        Appendage(body="ty", **parameters)
