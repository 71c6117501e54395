"""What the bench of protocols says of intervals: those of the true cause, machine by machine."""

import pytest

from tests.bench.protocols import FIRST, TESTS, deck, precision


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
