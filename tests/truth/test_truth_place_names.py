"""Names of places: those of the user's model, and those by which effects are drawn."""

import tomllib

import pytest
from any_machines import SERVO_AXIS

from truth.campaign.case_design import draw_case, fit_to_machine
from truth.campaign.further_tests import list_further_tests
from truth.campaign.place_names import (
    Choice,
    check_choice,
    find_place,
    named_direction,
    named_place,
)
from truth.campaign.protocol import Protocol
from truth.errors import TruthError
from truth.machine.mujoco_reader import read_station


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """A machine whose sensors have names before their numbers."""
    model = tmp_path_factory.mktemp("named") / "axis.xml"
    model.write_text(SERVO_AXIS.replace('"acc5"', '"lid-acc5"').replace('"acc1"', '"left_acc1"'))
    return read_station(model)


def test_places_go_from_the_names_of_the_model_and_back(station):
    for place, drawn in (
        ("sensor:lid-acc5", "sensor:acc5"),
        ("hammer:left_acc1", "hammer:acc1"),
        ("sensor:left_acc1+lid-acc5", "sensor:acc1+acc5"),
        ("body:slide", "body:slide"),
        ("pair:frame-slide", "pair:frame-slide"),
    ):
        assert find_place(place, station) == drawn
        assert named_place(drawn, station) == place
        assert find_place(drawn, station) == drawn
    assert find_place("", station) == ""
    assert named_direction("acc5:+ty", station) == "lid-acc5:+ty"


def test_a_place_that_the_machine_lacks_is_refused_with_those_that_it_has(station):
    with pytest.raises(TruthError, match="it has body:frame, body:slide"):
        find_place("body:lid", station)
    with pytest.raises(TruthError, match="sensor:lid-acc5"):
        find_place("sensor:lid-acc4", station)


def test_an_effect_at_a_place_of_another_kind_is_refused(station):
    protocol = Protocol((station.first_aim(),))
    check_choice(Choice(("mass_error",), ("body:slide",)), station, protocol)
    with pytest.raises(TruthError, match=r"mass_error cannot sit at 'joint:slide'.*body:<name>"):
        check_choice(Choice(("mass_error",), ("body:slide", "joint:slide")), station, protocol)


def test_a_case_is_drawn_at_a_place_by_the_name_of_the_model(station):
    choice = Choice(("sensor_gain",), ("sensor:lid-acc5",), parameter=("gain", 1.3))
    cases = (draw_case(station, 4, number, choice) for number in range(6))
    answers = [tomllib.loads(case.campaign.answer.decode()) for case in cases]
    places = {answer.get("location", "") for answer in answers if answer["effect"] != "none"}
    assert places == {"sensor:lid-acc5"}


def test_further_tests_have_the_names_of_the_model(station):
    protocol = fit_to_machine(Protocol((station.first_aim(),)), station)
    names = {test.name for test in list_further_tests(station, protocol)}
    assert "hammer point left_acc1" in names
