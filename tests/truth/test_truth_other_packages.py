"""Effects of other packages in virtual machines, by entry points."""

from importlib.metadata import EntryPoint

import pytest

from truth import Cause, Plan, Protocol, TruthError, Wanted, draw_campaign
from truth.effects import other_packages
from truth.effects.body_errors import draw_mass_error
from truth.machine.random_tree import draw_tree

THIS = "tests.truth.test_truth_other_packages"
draw_payload = draw_mass_error
NO_FUNCTION = 3.0


@pytest.fixture
def declare(monkeypatch):
    """Declare entry points for one test."""

    def named(**values):
        points = [EntryPoint(name, value, other_packages.GROUP) for name, value in values.items()]
        monkeypatch.setattr(other_packages, "entry_points", lambda group: points)
        other_packages.known_effects.cache_clear()

    yield named
    other_packages.known_effects.cache_clear()


def test_an_effect_of_another_package_is_drawn_by_its_name(declare):
    declare(payload=f"{THIS}:draw_payload")
    tree = draw_tree(4, 2)
    protocol = Protocol((tree.first_aim(),), lines=81, resolution_hz=2.0)
    answer = draw_campaign(tree, Plan(1, Cause((Wanted("payload"),)), protocol)).answer.decode()
    assert 'effect = "mass_error"' in answer  # what it says of itself


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("payload", "no_such_package:draw", "loading"),
        ("payload", f"{THIS}:NO_FUNCTION", "function"),
        ("drift", f"{THIS}:draw_payload", "taken"),
    ],
)
def test_a_wrong_entry_point_is_named(declare, name, value, words):
    declare(**{name: value})
    with pytest.raises(TruthError, match=f"{name}.*{words}"):
        other_packages.known_effects()
