"""Bodies that bend: where their solidity ends, and that no sensor is blamed for it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from solid_bodies import Case, draw

from identification import check_bodies

LINES = 200


def check(case: Case):
    (found,) = check_bodies(draw(case))
    return found


@pytest.mark.parametrize("size", [0.03, 0.1, 0.3])
def test_a_flexible_mode_ends_solidity_below_it_and_is_no_sensors_fault(size):
    for seed in range(2):
        found = check(Case(1500 + seed, lines=LINES, flex=(150.0, size)))
        assert [fault.effect for fault in found.faults] == ["flexible_body"], found.sentence
        assert found.faults[0].location == "body:body0"
        assert 60 < found.solid_to_hz < 148
        assert found.faults[0].parameters["frequency"] == pytest.approx(150, rel=0.05)


def twisted(case: Case) -> Case:
    """A plate whose corners go up and down in turn, strongly: one spare channel of height tells."""
    layout = draw(case).layout
    across = layout.positions[:, :2] - layout.positions[:, :2].mean(axis=0)
    rows = np.column_stack([np.ones(len(across)), across])
    turn = np.prod(across, axis=1)
    shape = turn - rows @ np.linalg.lstsq(rows, turn, rcond=None)[0]
    shape /= np.abs(shape).max()

    def read(freq, values):
        ratio = freq / 160.0
        gain = ratio**2 / (1 - ratio**2 + 0.02j * ratio)
        forced = gain[:, None] * values[:, :3].mean(axis=1)
        values = values.copy()
        values[:, 2::3] += 0.5 * shape[:, None] * forced[:, None]
        return values

    return replace(case, read=read)


@pytest.mark.parametrize("seed", range(4))
def test_a_plate_that_twists_is_flexible_though_any_of_its_corners_would_tell_as_much(seed):
    found = check(twisted(Case(1550 + seed, lines=LINES, level=True)))
    assert "flexible_body" in [fault.effect for fault in found.faults], found.sentence
    assert not any(fault.effect == "sensor_unknown" for fault in found.faults), found.sentence


def test_the_larger_the_flexible_motion_the_lower_the_limit():
    limits = [
        check(Case(1600, lines=LINES, flex=(150.0, size))).solid_to_hz for size in (0.02, 0.1, 0.5)
    ]
    assert all(a > b for a, b in pairwise(limits)), limits


def test_motion_that_is_flexible_by_less_than_a_percent_is_reported_and_still_solid():
    found = check(Case(1700, lines=LINES, noise=0.001, flex=(150.0, 0.005)))
    assert found.solid_to_hz == found.freq_hz[-1]
    assert not found.faults
    assert "as a solid within 0." in found.sentence
