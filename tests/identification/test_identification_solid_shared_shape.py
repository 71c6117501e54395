"""Bodies that bend: where their solidity ends, and that no sensor is blamed for it."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from solid_bodies import Case, draw

from identification import check_bodies
from identification.solid.body_channels import body_data, join_tests
from identification.solid.body_search import list_imitated
from identification.solid.fault_search import AcceptedFault, search_faults
from identification.solid.sensor_faults import BelievedBody, list_hypotheses

LINES = 200


def check(case: Case):
    (body_check,) = check_bodies(draw(case))
    return body_check


@cache
def check_flexible(seed: int, size: float):
    return check(Case(seed, lines=LINES, flex=(150.0, size)))


@pytest.mark.parametrize("size", [0.03, 0.1, 0.3])
def test_a_flexible_mode_ends_solidity_below_it_and_is_no_sensors_fault(size):
    body_check = check_flexible(1500, size)
    assert [fault.effect for fault in body_check.faults] == ["flexible_body"], body_check.sentence
    assert body_check.faults[0].location == "body:body0"
    assert 60 < body_check.solid_to_hz < 148
    assert body_check.faults[0].parameters["frequency"] == pytest.approx(150, rel=0.05)


def twisted(case: Case, size=0.5, frequency=160.0, corner=None, reversed_corner=None) -> Case:
    """A plate whose corners go up and down in turn: one redundant channel of height tells.

    The height of one corner forces the twist, or all motions of the first sensor.
    """
    layout = draw(case).layout
    across = layout.positions[:, :2] - layout.positions[:, :2].mean(axis=0)
    rows = np.column_stack([np.ones(len(across)), across])
    turn = np.prod(across, axis=1)
    shape = turn - rows @ np.linalg.lstsq(rows, turn, rcond=None)[0]
    shape /= np.abs(shape).max()

    def read(freq, values):
        ratio = freq / frequency
        gain = ratio**2 / (1 - ratio**2 + 0.02j * ratio)
        forcing = values[:, :3].mean(axis=1) if corner is None else values[:, 2 + 3 * corner]
        values = values.copy()
        values[:, 2::3] += size * shape[:, None] * (gain[:, None] * forcing)[:, None]
        if reversed_corner is not None:
            values[:, 2 + 3 * reversed_corner] *= -1
        return values

    return replace(case, read=read)


@pytest.mark.parametrize("seed", range(2))
def test_a_plate_that_twists_is_flexible_though_any_of_its_corners_would_tell_as_much(seed):
    body_check = check(twisted(Case(1550 + seed, lines=LINES, level=True)))
    assert "flexible_body" in [fault.effect for fault in body_check.faults], body_check.sentence
    assert not any(fault.effect == "sensor_unknown" for fault in body_check.faults), (
        body_check.sentence
    )


@pytest.mark.parametrize("frequency", [60.0, 160.0])
def test_a_plate_that_twists_more_than_it_moves_is_flexible_and_no_corner_is_blamed(frequency):
    body_check = check(twisted(Case(1570, lines=LINES, level=True), 2.0, frequency, corner=0))
    assert [fault.effect for fault in body_check.faults] == ["flexible_body"], body_check.sentence


@cache
def searched_plate(**twist):
    """The faults that were searched for on a twisted plate, its tolerance and its signs."""
    campaign = draw(twisted(Case(1571, lines=LINES, level=True), 1.0, 100.0, **twist))
    data = body_data(join_tests(campaign), campaign, "body0")
    search = search_faults(data, campaign.tolerance)
    signs = {
        hypothesis.location: hypothesis
        for hypothesis in list_hypotheses(BelievedBody.healthy(data, campaign.tolerance))
        if hypothesis.effect == "sensor_polarity" and hypothesis.dof == "tz"
    }
    return search, campaign.tolerance, signs


def imitated_signs(corners, **twist):
    """Signs that low lines contradict, if those of these corners were accepted."""
    search, tolerance, signs = searched_plate(**twist)
    accepted = tuple(AcceptedFault(signs[f"sensor:p0_{k}"], 1.0, ()) for k in corners)
    imitated = list_imitated(replace(search, accepted=accepted), tolerance)
    return {key[1] for key in imitated}


def test_a_wrong_sign_that_only_bending_imitates_is_contradicted_by_low_lines():
    for corner in range(4):
        assert imitated_signs((corner,)) == {f"sensor:p0_{corner}"}


def test_a_sign_that_is_wrong_stays_beside_bending():
    assert not imitated_signs((3,), reversed_corner=3)
    assert imitated_signs((3, 0), reversed_corner=3) == {"sensor:p0_0"}


def test_the_larger_the_flexible_motion_the_lower_the_limit():
    limits = [check_flexible(1500, size).solid_to_hz for size in (0.03, 0.1, 0.3)]
    assert all(a > b for a, b in pairwise(limits)), limits


def test_motion_that_is_flexible_by_less_than_a_percent_is_reported_and_still_solid():
    body_check = check(Case(1700, lines=LINES, noise=0.001, flex=(150.0, 0.005)))
    assert body_check.solid_to_hz == body_check.freq_hz[-1]
    assert not body_check.faults
    assert "as a solid within 0." in body_check.sentence
