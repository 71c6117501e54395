"""Names of places: two names of one place are one, and nonsense is refused."""

import re
from pathlib import Path

import pytest

from truth.effects import CATALOGUE as DRAWN
from truth.errors import TruthError
from truth.grade.verdict import CATALOGUE, canonical, check_place, direction, kind_of

CONTRACT = Path(__file__).parents[3] / "shared" / "FORMATS.md"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("sensor:acc1+acc2", "sensor:acc2+acc1"),
        ("pair:granite-ty", "pair:ty-granite"),
        ("pair:top-granite-ty", "pair:ty-top-granite"),
        ("pair:a-b-c-d", "pair:c-d-a-b"),
    ],
)
def test_the_order_of_two_names_does_not_matter(one, other):
    assert canonical(one) == canonical(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("sensor:acc1+acc2", "sensor:acc1+acc3"),
        ("sensor:acc1", "sensor:acc1+acc2"),
        ("body:ty", "joint:ty"),
        ("body:a-b", "body:b-a"),
        ("pair:a-b-c", "pair:c-b-a"),
    ],
)
def test_different_places_stay_different(one, other):
    assert canonical(one) != canonical(other)


@pytest.mark.parametrize(
    "location",
    ["", "ty", "body:", "bodies:ty", ":ty", "sensor:a+", "sensor:a+a", "sensor:a+b+c", "pair:ab",
     "pair:-b", "pair:a-"],
)  # fmt: skip
def test_what_is_no_location_is_refused(location):
    with pytest.raises(TruthError, match=re.escape(repr(location))):
        canonical(location)


@pytest.mark.parametrize(
    ("effect", "location", "words"),
    [
        ("inerter", "joint:ty", "'inerter' is not in the catalogue"),
        ("none", "joint:ty", "'none' is not in the catalogue"),
        ("appendage", "joint:ty", "sits at body"),
        ("friction", "body:ty", "sits at joint"),
        ("sensor_gain", "sensor:a+b", "one sensor"),
    ],
)
def test_an_effect_sits_at_its_kind_of_place(effect, location, words):
    with pytest.raises(TruthError, match=words):
        check_place(effect, location)


def test_two_sensors_may_be_exchanged():
    assert check_place("sensor_swap", "sensor:b+a") == "sensor:a+b"


def test_directions_of_a_swap_have_no_order():
    assert direction("ty+tx") == direction("tx+ty") == "tx+ty"
    assert direction("acc11:+ty") == "acc11:+ty"
    assert direction("") == ""


def test_the_kind_of_a_location_is_in_front():
    assert (kind_of("joint:ty"), kind_of("")) == ("joint", "")


def test_every_effect_that_is_drawn_can_be_graded():
    assert set(DRAWN) - {"none"} <= set(CATALOGUE)


def test_every_effect_of_the_catalogue_stands_in_the_contract():
    if not CONTRACT.is_file():
        pytest.skip(f"{CONTRACT} is absent")
    rows = re.findall(
        r"^\| ([`\w, ]+) \|[^|]*\| (\w+) \|[^|]*\| ?([^|]*)\|$", CONTRACT.read_text(), re.M
    )
    # The contract may already name effects that are still to come.
    contract = {
        name: (kind, parameters)
        for names, kind, parameters in rows
        for name in re.findall(r"`(\w+)`", names)
    }
    for name, effect in CATALOGUE.items():
        kind, parameters = contract[name]
        assert kind == effect.kind
        assert not effect.size or f"`{effect.size}`" in parameters
