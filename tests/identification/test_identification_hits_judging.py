"""Judgement of hits while a test runs: each kind of bad hit, and good ones of poor models."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_machine import MJCF

from identification.hits.judging import HitsToJudge, judge_hits
from identification.hits.settings import HitSettings
from identification.words import Dof, InputError, Tolerance
from mbmodel import (
    Evaluator,
    FrfRequest,
    HammerTestPlan,
    RecordedFile,
    as_drawn,
    load_machine,
    strike,
)

OUTPUTS = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 7) for axis in range(3))
PLACES = tuple(map(Dof.parse, ("acc1:+tx", "acc3:+ty", "acc2:+tz")))
LEVEL_N, HITS = 200.0, 4


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("judged") / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return load_machine(path)


@pytest.fixture(scope="module")
def records(machine):
    """Good hits at three places, with noise and instruments within all tolerances."""
    plan = HammerTestPlan((RecordedFile("a.npz", LEVEL_N, OUTPUTS, PLACES, HITS),), block_s=1.0)
    return strike(machine, plan, tolerance=Tolerance(), seed=4).records["a.npz"]


@pytest.fixture(scope="module")
def predict(machine):
    """The nominal model with all stiffness and damping off by factors."""
    model = as_drawn(machine)
    random = np.random.default_rng(8)
    theta = model.drawn * np.exp(random.normal(0, 0.5, len(model.drawn)))
    points = dict.fromkeys(place.point for place in PLACES)
    inputs = tuple(Dof.of(point, axis) for point in points for axis in range(3))

    def places(window, outputs):
        request = FrfRequest(window.freq_hz, outputs, inputs, window_tau=window.tau)
        values = Evaluator(model, request).at(theta).values
        return {dof: values[:, :, k] for k, dof in enumerate(inputs)}

    return places


def reasons(records, predict=None, *, level=LEVEL_N):
    tests = [HitsToJudge(each, peak_n=level) for each in records]
    judgement = judge_hits(tests, predict)
    return [[hit.reason for hit in hits] for hits in judgement.hits], judgement.remarks


def spoil(records, place, number, change):
    """The records with one hit of a place changed: force and motion of this hit."""
    one = records[place]
    force, motion = one.force.copy(), one.motion.copy()
    force[number], motion[number] = change(force[number], motion[number])
    changed = replace(one, force=force, motion=motion)
    return [*records[:place], changed, *records[place + 1 :]]


def turn(channel):
    def change(force, motion):
        motion[channel] *= -1
        return force, motion

    return change


@pytest.mark.parametrize("count", [1, 2, HITS])
def test_good_hits_are_accepted_with_a_model_that_is_off_by_factors(records, predict, count):
    some = [replace(r, force=r.force[:count], motion=r.motion[:count]) for r in records]
    found, remarks = reasons(some, predict)
    assert found == [[None] * count] * len(PLACES)
    assert remarks == ()


def test_good_hits_are_accepted_without_a_model(records):
    assert reasons(records)[0] == [[None] * HITS] * len(PLACES)


@pytest.mark.parametrize(("said", "struck"), [(0, 1), (1, 2), (2, 0)])
def test_the_first_hit_at_another_place_is_named_by_a_nominal_model(records, predict, said, struck):
    one = replace(
        records[struck],
        reference=PLACES[said],
        force=records[struck].force[:1],
        motion=records[struck].motion[:1],
    )
    ((reason,),), _ = reasons([one], predict)
    assert reason.startswith("looks like a hit at acc")  # points of one body are much alike
    assert reason.endswith(f":{PLACES[struck].direction}, not at {PLACES[said]}")


@pytest.mark.parametrize("count", [1, 2, 3, HITS])
def test_another_place_that_a_model_shows_in_most_of_three_hits_is_a_remark(
    records, predict, count
):
    struck = replace(
        records[1],
        reference=PLACES[0],
        force=records[1].force[:count],
        motion=records[1].motion[:count],
    )
    (judged,), remarks = reasons([struck], predict)
    if count < 3:
        assert all(reason.endswith(":+ty, not at acc1:+tx") for reason in judged)
        assert remarks == ()
        return
    assert judged == [None] * count
    (remark,) = remarks
    assert remark.startswith("hits at acc1:+tx look like hits at acc")
    (mixed,), _ = reasons(spoil([struck], 0, 1, lambda f, m: (f, -m)), predict)
    is_refused = [reason is not None for reason in mixed]
    assert is_refused == ([False, True, False, False] if count > 3 else [True] * 3)


def test_a_hit_from_the_other_side_is_named(records, predict):
    bad = spoil(records, 0, 2, lambda force, motion: (force, -motion))
    found, _ = reasons(bad, predict)
    assert found[0][2] == "looks like a hit at acc1:-tx, not at acc1:+tx"
    assert found[0][:2] == [None, None]


def test_a_reference_along_the_negative_axis_is_compared_along_it(records, predict):
    one = replace(records[0], reference=Dof.parse("acc1:-tx"), motion=-records[0].motion)
    assert reasons([one], predict)[0] == [[None] * HITS]


def test_a_wrong_place_is_known_from_earlier_hits_without_a_model(records):
    bad = spoil(
        records, 1, 1, lambda force, motion: (records[0].force[3], records[0].motion[3].copy())
    )
    found, _ = reasons(bad)
    assert found[1][1] == "looks like a hit at acc1:+tx, not at acc3:+ty"


def test_a_turned_channel_is_named(records, predict):
    for model in (None, predict):
        found, _ = reasons(spoil(records, 0, 3, turn(0)), model)
        assert found[0] == [None, None, None, "acc1:+tx reads with the opposite sign"]


def test_a_channel_that_is_turned_in_all_hits_is_a_remark(records, predict):
    motions = [each.motion * np.where(np.arange(18) == 0, -1, 1)[:, None] for each in records]
    bad = [replace(each, motion=m) for each, m in zip(records, motions, strict=True)]
    found, remarks = reasons(bad, predict)
    assert found == [[None] * HITS] * len(PLACES)
    assert any("acc1:+tx reads with the opposite sign in most hits" in text for text in remarks)


def test_swapped_channels_are_named(records):
    def swap(force, motion):
        motion[[0, 9]] = motion[[9, 0]]
        return force, motion

    found, _ = reasons(spoil(records, 0, 1, swap))
    # The head hardly turns about y: its sensors along x read nearly the same.
    assert found[0][1] in [f"acc1:+tx and acc{k}:+tx are exchanged" for k in (3, 4, 6)]
    assert found[0][2:] == [None, None]


def test_a_dead_channel_is_named(records):
    def cut(force, motion):
        motion[3] *= 1e-3
        return force, motion

    found, _ = reasons(spoil(records, 0, 2, cut))
    assert found[0][2] == "acc2:+tx seems dead: look at its cable"


def test_a_crackling_cable_is_named_by_its_noise_before_the_hit(records):
    noise = np.random.default_rng(1).standard_normal(records[0].motion.shape[2])

    def crackle(force, motion):
        motion[16] += 0.05 * np.abs(motion).max() * noise
        return force, motion

    found, _ = reasons(spoil(records, 0, 1, crackle))
    assert "acc6:+ty has other noise before the hit" in found[0][1]


def test_few_weak_hits_are_weak_against_the_planned_peak(records):
    one = replace(records[0], force=records[0].force[:1], motion=records[0].motion[:1])
    ((reason,),), _ = reasons([one], level=1000.0)
    assert reason.startswith("weak: 0.")


def test_a_double_hit_is_named(records):
    def bounce(force, motion):
        shift = 30
        force[shift:] += 0.5 * force[:-shift]
        motion[:, shift:] += 0.5 * motion[:, :-shift]
        return force, motion

    found, _ = reasons(spoil(records, 2, 0, bounce))
    assert "double hit" in found[2][0]


def test_limits_of_a_converter_on_both_sides_are_an_overload(records):
    def clip(force, motion):
        limit = 1.3 * np.abs(records[0].motion).max()
        return 5 * force, np.clip(5 * motion, -limit, limit)

    found, _ = reasons(spoil(records, 0, 3, clip))
    assert found[0][3].endswith("is overloaded")
    assert found[0][:3] == [None, None, None]


def test_a_bad_first_hit_is_found_by_later_ones(records):
    states = []
    for count in range(1, HITS + 1):
        bad = spoil(records, 0, 0, turn(0))
        some = [replace(bad[0], force=bad[0].force[:count], motion=bad[0].motion[:count])]
        states.append(reasons(some)[0][0])
    assert states[0] == [None]
    assert "acc1:+tx" in states[2][0]
    assert states[-1][1:] == [None] * (HITS - 1)


def test_rejection_can_be_switched_off(records):
    bad = spoil(records, 0, 3, turn(0))
    tests = [HitsToJudge(each, HitSettings(reject=False)) for each in bad]
    assert all(hit.reason is None for hits in judge_hits(tests).hits for hit in hits)


def test_a_force_without_hits_is_refused(records):
    random = np.random.default_rng(0)
    one = replace(records[0], force=random.standard_normal(records[0].force.shape))
    with pytest.raises(InputError, match="no series of hits"):
        judge_hits([HitsToJudge(one)])


def test_hits_are_numbered_as_they_come(records):
    for hits in judge_hits([HitsToJudge(each) for each in records]).hits:
        assert all(b.record == a.record + 1 for a, b in pairwise(hits))
        assert all(hit.number == hit.record for hit in hits)
