"""Channels that die in some tests: left out there, unless nothing moves."""

from dataclasses import replace

import numpy as np
import pytest

from identification.checks.dead_in_tests import leave_out_dead_channels
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

SITES = ("acc1", "acc2", "acc3", "acc4")
PLACES = np.array([[0.3, 0.1, 0.2], [-0.2, 0.3, 0.1], [0.1, -0.3, -0.2], [-0.25, -0.1, 0.3]])
LAYOUT = Layout(
    ("b",), np.zeros((1, 3)), SITES, np.zeros(4, int), PLACES, np.tile(np.eye(3), (4, 1, 1))
)
OUTPUTS = tuple(Dof.of(site, axis) for site in SITES for axis in range(3))
FREQ_HZ = np.linspace(10, 60, 60)


def rows():
    """Readings per motion of the body: [a, r x a]."""
    return np.array([[*np.eye(3)[k], *np.cross(r, np.eye(3)[k])] for r in PLACES for k in range(3)])


def campaign(*, dead=(), still=(), n_channel=12):
    """Three hits on a body with motions of its own; noise a hundredth of the motion.

    Args:
        dead: channels that read noise in the second test.
        still: motions of the body that the second hit does not excite.
        n_channel: number of channels.
    """
    rng = np.random.default_rng(6)
    tests = []
    for k, label in enumerate(("acc1:+tx", "acc1:+ty", "acc1:+tz")):
        motion = rng.normal(size=(60, 6, 2)) @ [1, 1j]
        noise = 1e-2 * rng.normal(size=(60, 12, 2)) @ [1, 1j]
        if k == 1:
            motion[:, list(still)] = 0
        values = motion @ rows().T
        if k == 1:
            values[:, list(dead)] = 0
        size = np.abs(values) ** 2
        coherence = (size + 2e-5) / (size + 2e-4)
        values = (values + noise)[:, :n_channel, None]
        reference = Dof.parse(label)
        frf = Frf(FREQ_HZ, values, OUTPUTS[:n_channel], (reference,), "accelerance")
        estimate = FrfEstimate(
            frf,
            np.full(values.shape, 2e-4),
            "coherence",
            np.ones((n_channel, 1), bool),
            coherence[:, :n_channel, None],
            10,
        )
        tests.append(Test(Condition("a.uff", reference), estimate))
    return Campaign("c", LAYOUT, tuple(tests))


def channels(of):
    return [len(test.estimate.frf.outputs) for test in of.tests]


@pytest.mark.parametrize("dead", [[9, 10, 11], [4]], ids=["a sensor", "a channel"])
def test_a_channel_dead_in_one_test_is_left_out_there(dead):
    changed, (remark,) = leave_out_dead_channels(campaign(dead=dead))
    assert channels(changed) == [12, 12 - len(dead), 12]
    left_out = {dof for k, dof in enumerate(OUTPUTS) if k in dead}
    assert set(OUTPUTS) - set(changed.tests[1].estimate.frf.outputs) == left_out
    assert "if hit at acc1:+ty" in remark
    assert all(str(dof) in remark for dof in left_out)


def test_channels_along_which_nothing_moves_stay():
    # Without motion along y and about x and z the y channels of all sensors read noise.
    changed, remarks = leave_out_dead_channels(campaign(still=[1, 3, 5]))
    assert channels(changed) == [12, 12, 12]
    assert remarks == ()


def test_a_channel_whose_motion_is_unknown_stays_with_a_remark():
    changed, (remark,) = leave_out_dead_channels(campaign(dead=[4], n_channel=5))
    assert channels(changed) == [5, 5, 5]
    assert "or nothing moves there" in remark


def test_a_body_without_redundant_channels_tells_a_dead_sensor_by_all_its_channels():
    changed, (remark,) = leave_out_dead_channels(campaign(dead=[3, 4, 5], n_channel=6))
    assert channels(changed) == [6, 3, 6]
    assert "a cable was off" in remark


def test_a_weak_sensor_that_reads_more_than_noise_stays_where_its_body_cannot_confirm_it():
    # Noise alone has a coherence of 0.1 at most; 0.15 of each channel is little, but a response.
    sound = campaign(n_channel=6)
    weak = sound.tests[1].estimate
    coherence = weak.coherence.copy()
    coherence[:, 3:] = 0.15
    tests = (sound.tests[0], replace(sound.tests[1], estimate=replace(weak, coherence=coherence)))
    changed, remarks = leave_out_dead_channels(replace(sound, tests=tests))
    assert channels(changed) == [6, 6]
    assert remarks == ()


def test_sound_tests_and_channels_dead_in_every_test_are_left_as_they_are():
    sound = campaign()
    assert leave_out_dead_channels(sound)[1] == ()
    (broken,) = campaign(dead=[4]).tests[1:2]
    assert channels(leave_out_dead_channels(replace(sound, tests=(broken,)))[0]) == [12]


def test_a_weak_channel_that_reads_what_its_body_moves_is_no_dead_one():
    # The second hit moves the body along one axis by little more than the noise: coherence is low,
    # but the channels agree with one another.
    weak = campaign(still=(1, 2, 3, 4, 5))
    test = weak.tests[1]
    estimate, along = test.estimate, [k for k, dof in enumerate(OUTPUTS) if dof.axis == 1]
    values = estimate.frf.values.copy()
    motion = 6e-2 * np.ones(len(FREQ_HZ))
    values[:, along, 0] = values[:, along, 0] + motion[:, None]
    coherence = estimate.coherence.copy()
    coherence[:, along] = 0.05
    frf = replace(estimate.frf, values=values)
    tests = list(weak.tests)
    tests[1] = replace(test, estimate=replace(estimate, frf=frf, coherence=coherence))
    left, remarks = leave_out_dead_channels(replace(weak, tests=tuple(tests)))
    assert len(left.tests[1].estimate.frf.outputs) == len(OUTPUTS)
    assert not any("a cable was off; left out" in remark for remark in remarks)
