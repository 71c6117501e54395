"""Reciprocity: ratios of gains, differences of delays, signs and exchanges, without a model."""

from dataclasses import replace

import numpy as np
import pytest

from identification import check_reciprocity
from identification.checks.reciprocity import _Square
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Layout,
    Test,
    Tolerance,
)
from tests.bench.reciprocity import draw_case

FREQ_HZ = np.linspace(2.0, 60.0, 800)
NOISE = 0.003  # of the largest FRF at each line
OTHERS = ("acc2:+ty", "acc3:+ty")
GAINS, DELAYS = np.array([1.0, 1.12, 0.97]), np.array([0.0, 4e-4, 0.0])


def chain(rng):
    """Return the accelerance of three masses on springs; (n_freq, 3, 3)."""
    mass = np.diag(rng.uniform(4.0, 6.0, 3))
    springs = rng.uniform(4e4, 7e4, 3)
    stiffness = np.diag(springs) + np.diag([*springs[1:], 0.0])
    stiffness -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    omega = 2 * np.pi * FREQ_HZ[:, None, None]
    return -(omega**2) * np.linalg.inv(stiffness * (1 + 0.01j) - omega**2 * mass)


def campaign_of(values, rng, names=("acc1", "acc2", "acc3"), noise=NOISE, **conditions):
    """Return a test at each of three bodies, each of which has one sensor."""
    layout = Layout(
        ("a", "b", "c"),
        np.zeros((3, 3)),
        names,
        np.arange(3),
        np.zeros((3, 3)),
        np.tile(np.eye(3), (3, 1, 1)),
    )
    dofs = tuple(Dof(name, "+tx") for name in names)
    level = noise * np.abs(values).max(axis=(1, 2), keepdims=True)
    drawn = rng.standard_normal((2, *values.shape))
    values = values + level * (drawn[0] + 1j * drawn[1]) / np.sqrt(2)
    variance = np.broadcast_to(level**2, values.shape)
    tests = []
    for column, dof in enumerate(dofs):
        frf = Frf(FREQ_HZ, values[:, :, [column]], dofs, (dof,), "accelerance")
        estimate = FrfEstimate(frf, variance[:, :, [column]], "stated", np.ones((3, 1), bool))
        tests.append(Test(Condition(f"t{column}", dof, **conditions), estimate))
    return Campaign("chain", layout, tuple(tests))


def read_by(values, gains=GAINS, delays=DELAYS):
    late = np.exp(-2j * np.pi * FREQ_HZ[:, None] * delays)
    return values * (gains * late)[:, :, None]


def test_ratios_of_gains_and_delays_lie_within_their_deviations():
    missed = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        found = check_reciprocity(campaign_of(read_by(chain(rng)), rng))
        usual = np.median(GAINS), np.median(DELAYS)
        assert found.error < 0.01
        for row, gain, delay in zip(found.rows, GAINS, DELAYS, strict=True):
            if row.gain_sd:
                missed.append(abs(row.gain - gain / usual[0]) > 2.2 * row.gain_sd)
            if row.delay_sd:
                missed.append(abs(row.delay - (delay - usual[1])) > 2.2 * row.delay_sd)
    assert np.mean(missed) < 0.08  # Student's 95 %; some 200 of them


def test_cross_talk_widens_the_deviations_and_raises_no_alarm():
    within = []
    for seed in range(100, 130):
        rng = np.random.default_rng(seed)
        cross = np.eye(3) + 0.02 * (rng.standard_normal((3, 3)) * (1 - np.eye(3)))
        campaign = campaign_of(cross @ chain(rng), rng)
        found = check_reciprocity(campaign)
        assert found.error > 0.003
        assert found.faults(campaign) == []
        within += [abs(row.gain - 1) < 2.2 * row.gain_sd for row in found.rows if row.gain_sd]
    assert np.mean(within) > 0.8  # the errors of three modes are no large sample


def test_a_gain_and_a_delay_beyond_tolerances_are_faults_of_the_channel():
    rng = np.random.default_rng(5)
    campaign = campaign_of(read_by(chain(rng)), rng)
    found = check_reciprocity(campaign)
    faults = {fault.effect: fault for fault in found.faults(campaign)}
    assert set(faults) == {"sensor_gain", "sensor_delay"}
    assert all(fault.location == "sensor:acc2" for fault in faults.values())
    assert faults["sensor_gain"].parameters["gain"] == pytest.approx(1.12, rel=0.01)
    assert faults["sensor_delay"].parameters["delay"] == pytest.approx(4e-4, rel=0.05)
    first, second = found.remarks(campaign.tolerance)
    assert "acc2:+tx or the hits at acc2:+tx have another gain" in first
    assert "0.4 ms" in second
    assert "later" in second


def test_what_tolerances_hold_is_not_said():
    rng = np.random.default_rng(6)
    campaign = campaign_of(read_by(chain(rng), 1 + 0.3 * (GAINS - 1), 0.1 * DELAYS), rng)
    found = check_reciprocity(campaign)
    assert found.remarks(campaign.tolerance) == []
    assert found.faults(campaign) == []
    assert found.remarks(Tolerance(sensor_gain=1e-4, hammer_gain=1e-4)) == []  # usual ones


def test_a_common_gain_stays_silent():
    rng = np.random.default_rng(7)
    found = check_reciprocity(campaign_of(read_by(chain(rng), np.full(3, 1.3), 0 * DELAYS), rng))
    assert found.remarks(Tolerance()) == []


@pytest.mark.parametrize("side", ["channels", "hits"])
def test_an_exchange_is_of_channels_or_of_hits(side):
    rng = np.random.default_rng(8)
    values = chain(rng)
    order = [0, 2, 1]
    campaign = campaign_of(values[:, order] if side == "channels" else values[:, :, order], rng)
    found = check_reciprocity(campaign)
    (sentence,) = found.remarks(campaign.tolerance)
    assert "acc2:+tx and acc3:+tx are exchanged, or the hits there" in sentence
    (fault,) = found.faults(campaign)
    assert (fault.effect, fault.location) == ("sensor_swap", "sensor:acc2+acc3")


def test_alike_bodies_that_do_not_move_each_other_are_not_called_exchanged():
    rng = np.random.default_rng(8)
    values = chain(rng)
    values[:, 2], values[:, :, 2] = values[:, 0], values[:, :, 0]
    values[:, 2, 2] = values[:, 0, 0]
    values[:, 0, 2] = values[:, 2, 0] = 0.0
    assert check_reciprocity(campaign_of(values, rng)) is None  # noise alone between the two


def test_drive_points_take_up_power_unless_the_sign_of_some_is_wrong():
    values = chain(np.random.default_rng(8))
    square = _Square(2j * np.pi * FREQ_HZ, values, np.zeros(values.shape), 2)
    assert square.takes_up_power(np.ones(3))
    assert square.takes_up_power(-np.ones(3))  # of all channels no sign is known
    assert not square.takes_up_power(np.array([1.0, -1.0, 1.0]))


def test_an_exchange_of_some_channels_of_two_sensors_is_a_remark_alone():
    rng = np.random.default_rng(8)
    campaign = campaign_of(chain(rng)[:, [0, 2, 1]], rng)
    test = campaign.tests[0]
    frf = replace(test.estimate.frf, outputs=(Dof("acc1", "+tx"), *map(Dof.parse, OTHERS)))
    found = check_reciprocity(campaign)
    more = replace(test, estimate=replace(test.estimate, frf=frf))
    assert found.remarks(campaign.tolerance)
    assert found.faults(replace(campaign, tests=(*campaign.tests, more))) == []


def test_a_reversed_channel_is_found():
    rng = np.random.default_rng(9)
    campaign = campaign_of(read_by(chain(rng), np.array([1.0, 1.0, -1.0]), 0 * DELAYS), rng)
    (fault,) = check_reciprocity(campaign).faults(campaign)
    assert (fault.effect, fault.location, fault.dof) == ("sensor_polarity", "sensor:acc3", "tx")


def test_a_rotor_makes_it_a_hint_that_names_no_fault():
    rng = np.random.default_rng(10)
    campaign = campaign_of(read_by(chain(rng)), rng, spindle_speed=100.0)
    found = check_reciprocity(campaign)
    assert "a hint, since a spinning rotor" in found.remarks(campaign.tolerance)[0]
    assert found.faults(campaign) == []


def test_hits_with_force_channels_of_their_own_name_no_sensor():
    rng = np.random.default_rng(11)
    campaign = campaign_of(read_by(chain(rng)), rng)
    tests = [
        replace(test, condition=replace(test.condition, hammer=f"h{number}"))
        for number, test in enumerate(campaign.tests)
    ]
    campaign = replace(campaign, tests=tuple(tests))
    found = check_reciprocity(campaign)
    assert found.remarks(campaign.tolerance)
    assert found.faults(campaign) == []


def test_unrelated_frfs_say_nothing():
    rng = np.random.default_rng(12)
    noise = rng.standard_normal((2, len(FREQ_HZ), 3, 3))
    assert check_reciprocity(campaign_of(noise[0] + 1j * noise[1], rng, noise=0.01)) is None


def test_motion_is_carried_on_the_rigid_body_to_where_no_sensor_is():
    """A hammer at two points of one free body, with three triaxial sensors elsewhere."""
    rng = np.random.default_rng(13)
    names, hits = ("acc1", "acc2", "acc3"), ("hit8", "hit9")
    places = np.vstack([np.diag([0.3, 0.2, 0.25]), [[0.1, -0.2, 0.15], [-0.2, 0.1, 0.3]]])
    layout = Layout(
        ("b",), np.zeros((1, 3)), (*names, *hits), np.zeros(5, int), places,
        np.tile(np.eye(3), (5, 1, 1)),
    )  # fmt: skip
    outputs = tuple(Dof(name, f"+t{axis}") for name in names for axis in "xyz")
    forces = (Dof("hit8", "+tx"), Dof("hit8", "+tz"), Dof("hit9", "+ty"))
    mass = np.diag([5.0, 5.0, 5.0, 0.1, 0.12, 0.15])
    stiffness = np.diag([3e4, 5e4, 8e4, 1e3, 2e3, 3e3]) * (1 + 0.02j)
    omega = 2 * np.pi * FREQ_HZ[:, None, None]
    rigid = -(omega**2) * np.linalg.inv(stiffness - omega**2 * mass)
    rows, columns = layout.rows(outputs), layout.rows(forces)
    values = rows @ rigid @ columns.T
    values[:, :, 2] /= 1.2  # the force at hit9 is recorded too large
    level = 1e-3 * np.abs(values).max(axis=(1, 2), keepdims=True)
    drawn = rng.standard_normal((2, *values.shape))
    values = values + level * (drawn[0] + 1j * drawn[1])
    tests = []
    for column, force in enumerate(forces):
        frf = Frf(FREQ_HZ, values[:, :, [column]], outputs, (force,), "accelerance")
        variance = np.broadcast_to(2 * level**2, frf.values.shape)
        estimate = FrfEstimate(frf, variance, "stated", np.ones((9, 1), bool))
        tests.append(Test(Condition(f"t{column}", force), estimate))
    found = check_reciprocity(Campaign("body", layout, tuple(tests)))
    rows = {row.reference: row for row in found.rows}
    assert {row.channel for row in found.rows} == {"the sensors of b"}
    assert rows["hit9:+ty"].gain == pytest.approx(1.2, abs=4 * rows["hit9:+ty"].gain_sd)
    assert rows["hit9:+ty"].gain_sd < 0.03
    assert found.faults(Campaign("body", layout, tuple(tests))) == []


def test_ratios_of_directions_at_one_point_are_not_named():
    """Hits in three directions at one sensor may be tilted, which feigns gains."""
    rng = np.random.default_rng(14)
    campaign = campaign_of(read_by(chain(rng)), rng)
    assert check_reciprocity(campaign).faults(campaign)
    dofs = tuple(Dof("acc1", f"+t{axis}") for axis in "xyz")
    tests = []
    for test, dof in zip(campaign.tests, dofs, strict=True):
        frf = replace(test.estimate.frf, outputs=dofs, inputs=(dof,))
        condition = replace(test.condition, reference=dof)
        tests.append(Test(condition, replace(test.estimate, frf=frf)))
    campaign = replace(campaign, tests=tuple(tests))
    found = check_reciprocity(campaign)
    assert found.faults(campaign) == []
    assert found.remarks(campaign.tolerance) == []


@pytest.mark.parametrize("number", [2, 5, 6, 7])
def test_ratios_of_a_changed_tower_are_within_their_deviations(number):
    case = draw_case(number)
    assert np.abs(case["gain"]).max() < 3
    assert np.abs(case["delay"]).max() < 3
    assert case["right"] == (case["kind"] in ("nothing", "gain", "delay"))
    assert not case["named"] or case["kind"] in ("gain", "delay")


def test_what_broke_reciprocity_before_a_change_counts_no_more():
    # Both visits have the same cross-talk as dynamic stiffness; a mass is added between them.
    rng = np.random.default_rng(3)
    scale = -((2 * np.pi * FREQ_HZ[:, None, None]) ** 2)
    stiffness = scale * np.linalg.inv(chain(rng))
    talk = 1e3 * np.array([[0, 1, -1], [-1, 0, 1], [1, -1, 0]])
    added = scale * np.diag([0.8, 0.0, 0.0])
    before = campaign_of(scale * np.linalg.inv(stiffness + talk), rng, noise=1e-4)
    values = scale * np.linalg.inv(stiffness + talk + added)
    after = campaign_of(read_by(values), rng, noise=1e-4)
    alone, compared = check_reciprocity(after), check_reciprocity(after, before=before)
    errors = [
        max(
            max(abs(row.gain / gain - 1), abs(row.delay - delay) / 1e-3)
            for row, gain, delay in zip(found.rows, GAINS, DELAYS, strict=True)
        )
        for found in (alone, compared)
    ]
    assert compared.error < 0.02 * alone.error
    assert errors[1] < 0.02  # the product of cross-talk and factors stays
    assert errors[1] < 0.6 * errors[0]
