"""A size beside those that are usually drawn."""

import numpy as np
import pytest
from any_machines import SERVO_AXIS

from truth import OwnTest, Protocol, Tolerances, compare_with_usual, fit_to_machine
from truth.machine.mujoco_reader import read_station


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "servo.xml"
    path.write_text(SERVO_AXIS)
    station = read_station(path)
    protocol = fit_to_machine(Protocol((station.first_aim(),)), station)
    return station, OwnTest(protocol, Tolerances())


def test_twice_the_mass_is_twice_the_usual_size(machine):
    cause = ("mass_error", "body:slide", "")
    one, two = (compare_with_usual(*machine, cause, ("mass", mass)) for mass in (1.0, 2.0))
    assert two == pytest.approx(2 * one)


def test_a_softer_direction_is_a_larger_effect(machine):
    cause = ("missing_dof", "joint:slide", "rx")
    stiff, soft = (compare_with_usual(*machine, cause, ("stiffness", k)) for k in (2e8, 1e8))
    assert soft > 1.5 * stiff


def test_a_size_that_no_machine_has_is_infinite(machine):
    assert compare_with_usual(*machine, ("mass_error", "body:slide", ""), ("mass", 1e6)) == np.inf


def test_an_effect_that_is_not_drawn_at_a_place_has_no_usual_size(machine):
    cause = ("gyroscopic", "body:slide", "")
    assert compare_with_usual(*machine, cause, ("angular_momentum", 1.0)) is None
