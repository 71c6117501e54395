"""What benches say beside grades: widths of intervals, and how true stated probabilities are."""

import pytest

from tests.bench import catalogue, real
from tests.bench.diagnosis import rejudged
from tests.bench.doubt import reliability
from tests.bench.kept import of
from tests.bench.protocols import FIRST, TESTS, deck, precision
from tests.helpers.changed_tower import Change

MASS = Change("mass_error", "body:floor1", {"mass": 1.0})
LEG = Change("stiffness", "joint:floor2", {"stiffness": -5000.0})
GAIN = Change("hammer_gain", "hammer:default", {"gain": 1.1})


def row(number, width, effect="appendage"):
    cause = {"effect": effect, "location": "body:a", "interval": {"mass": [2.0, 2.0 + width]}}
    answer = 'effect = "appendage"\nlocation = "body:a"\n'
    return {"seed": FIRST + number, "answer": answer, "verdict": {"causes": [cause]}}


def test_widths_are_compared_machine_by_machine():
    plain = [n for n, card in enumerate(deck().cards) if card.test == TESTS[0] and card.ratio == 1]
    rows = [row(n + k, 3.0 / (1 + k)) for n in plain[:3] for k in range(len(TESTS))]
    rows[1] = row(plain[0] + 1, 3.0, effect="mass_error")  # a wrong cause's say nothing
    found = {one["figure"]: one for one in precision(rows)}
    width = found["width of intervals over those of the plain test, two points at 1"]
    assert (width["value"], width["n"]) == (pytest.approx(0.5), 2)
    width = found["width of intervals over those of the plain test, no coherence at 1"]
    assert (width["value"], width["n"]) == (pytest.approx(1 / 3), 3)
    assert found["machines where they are narrower, two points at 1, %"]["value"] == 100
    assert len(found) == 4  # nothing is said of the other ratio


def test_causes_are_true_as_often_as_answers_name_them():
    rows = [one for one in of(f"catalogue.{catalogue.FIRST}").values() if one["verdict"]][:60]
    stated = [cause["probability"] for one in rows for cause in rejudged(one)["causes"]]
    found = reliability(rows)
    assert sum(one["n"] for one in found) == len(stated) > 50
    assert found[-1]["n"] == sum(p >= 0.95 for p in stated)
    assert found[-1]["value"] > 90
    lies = [one | {"answer": 'effect = "none"\n'} for one in rows]
    assert [one["value"] for one in reliability(lies)] == [0.0] * len(found)
    assert reliability([{"verdict": None}]) == []


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
