"""Changes of the measured tower are graded by one rule; those of two visits have a ratio."""

import pytest

from tests.bench import compare, real
from truth.campaign.changed_tower import TowerChange

MASS = TowerChange("mass_error", "body:floor1", {"mass": 1.0})
LEG = TowerChange("stiffness", "joint:floor2", {"stiffness": -5000.0})
GAIN = TowerChange("hammer_gain", "hammer:default", {"gain": 1.1})


@pytest.mark.parametrize(
    ("change", "causes", "legs", "expected"),
    [
        (MASS, {"body:floor1": ("mass_error", {"mass": 1.05})}, {}, (True, False, True)),
        (MASS, {"body:floor1": ("mass_error", {"mass": 1.2})}, {}, (True, False, False)),
        (MASS, {"body:floor2": ("mass_error", {"mass": 1.0})}, {}, (False, True, None)),
        (LEG, {"joint:floor2": ("stiffness", {"change": -5100.0})}, {}, (True, False, True)),
        (LEG, {}, {"leg2": -5600.0}, (True, False, False)),
        (LEG, {}, {"leg2": -500.0}, (False, False, None)),
        (GAIN, {"hammer:acc1": ("hammer_gain", {"gain": 1.11})}, {}, (True, False, True)),
        (
            GAIN,
            {f"body:floor{k}": ("mass_error", {"mass": 0.5}) for k in (1, 2, 3)},
            {},
            (True, False, None),
        ),
    ],
)
def test_changes_of_the_tower_are_graded_by_one_rule(change, causes, legs, expected):
    verdict = {
        "causes": [
            {"effect": effect, "location": place, "parameters": sizes, "probability": 0.9}
            for place, (effect, sizes) in causes.items()
        ]
    }
    assert tuple(real.grade([change], verdict, legs).values()) == expected


def test_a_change_between_two_visits_counts_within_the_limits_of_its_ratio():
    assert compare.has_ratio('effect = "mass_error"\nratio = 4.0\n')
    assert not compare.has_ratio('effect = "mass_error"\nratio = 0.4\n')
    assert not compare.has_ratio('effect = "none"\n')
    cells = [design.cell for design in compare.list_designs()]
    assert (cells.count("change"), cells.count("nothing")) == (60, 30)
