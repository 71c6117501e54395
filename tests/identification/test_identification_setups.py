"""Set-ups of a roved test: agreement, gains and drifts found, with their intervals."""

from dataclasses import replace

import numpy as np
import pytest
from hammer_records import System, a_system
from identification_examples import a_layout, an_estimate

from identification.checks.setups import compare_setups
from identification.words import Campaign, Condition, Dof, Test

FREQ = 20.0 + 0.25 * np.arange(600)
SYSTEM = a_system(n_out=6, damping=0.02)
NAMES = ("acc1:+tx", "acc1:+ty", "acc2:+tx", "acc2:-tz", "acc7:+tx", "acc7:+tz")
HIT = Dof.parse("hit11:+tz")


def drifted(shift):
    return replace(SYSTEM, freq_hz=SYSTEM.freq_hz * (1 + shift))


def a_test(rows, setup, *, system=SYSTEM, noise=0.01, seed=1, gain=1.0, reference=HIT, **condition):
    """A test of some channels, noise a share of their rms."""
    rng = np.random.default_rng(seed)
    clean = system.accelerance(2j * np.pi * FREQ)[:, rows] * gain
    sd = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
    error = rng.normal(size=(2, *clean.shape)) / np.sqrt(2) * sd
    values = (clean + error[0] + 1j * error[1])[:, :, None]
    estimate = an_estimate(
        values,
        [Dof.parse(NAMES[row]) for row in rows],
        [reference],
        variance=np.broadcast_to(sd[:, None] ** 2, values.shape),
        freq_hz=FREQ,
    )
    return Test(Condition("a.uff", reference, setup=setup, **condition), estimate)


def check(*tests):
    return compare_setups(Campaign("camp", a_layout(), tests))


FIRST = a_test([0, 1, 2], "a")


def test_two_set_ups_of_one_machine_agree():
    (found,) = check(FIRST, a_test([4, 2, 1], "b", seed=2))
    assert found.agrees
    assert [str(dof) for dof in found.shared] == ["acc1:+ty", "acc2:+tx"]
    assert found.excess == pytest.approx(1.0, abs=0.07)  # 1200 values
    assert (found.frac > 0.999).all()
    np.testing.assert_allclose(found.scale, 1.0, atol=0.005)
    assert abs(found.shift) < 3 * found.shift_sd
    assert found.shift_sd < 1e-4


def test_the_shift_of_frequencies_lies_within_its_interval():
    # 30 drawings of the noise: the pull has a standard deviation of one, certain to 13 %.
    pulls = []
    for seed in range(30):
        other = a_test([1, 2], "b", system=drifted(2e-3), seed=100 + seed)
        (found,) = check(a_test([0, 1, 2], "a", seed=500 + seed), other)
        pulls.append((found.shift - 2e-3) / found.shift_sd)
    assert np.std(pulls) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(pulls)) < 0.6


@pytest.mark.parametrize("shift", [-0.03, -0.002, 0.004, 0.04])
def test_a_drift_is_found_and_said(shift):
    (found,) = check(FIRST, a_test([1, 2], "b", system=drifted(shift), seed=2))
    assert not found.agrees
    assert found.shift == pytest.approx(shift, abs=2e-4)
    assert f"frequencies shift by {100 * found.shift:+.3f} +- " in found.sentence
    assert "set-up a and set-up b, hammer at hit11:+tz differ" in found.sentence


@pytest.mark.parametrize("gain", [0.9, 1.05, -1.0])
def test_a_gain_is_found_and_no_drift(gain):
    (found,) = check(FIRST, a_test([1, 2], "b", gain=gain, seed=2))
    np.testing.assert_allclose(found.scale, gain, rtol=0.003)
    assert not found.agrees
    assert abs(found.shift) < 4 * found.shift_sd
    assert (found.frac > 0.999).all()


def test_another_machine_has_a_low_frac():
    other = System(SYSTEM.freq_hz + 7, SYSTEM.damping, SYSTEM.shapes[::-1], SYSTEM.drive)
    (found,) = check(FIRST, a_test([1, 2], "b", system=other, seed=2))
    assert found.frac.max() < 0.5
    assert found.excess > 20


def test_signs_of_channels_and_hammer_do_not_count():
    turned = a_test([3], "b", gain=-1.0, reference=Dof.parse("hit11:-tz"), seed=2)
    (found,) = check(a_test([3], "a"), turned)
    assert found.agrees
    np.testing.assert_allclose(found.scale, 1.0, atol=0.01)
    frf = replace(turned.estimate.frf, outputs=(Dof.parse("acc2:+tz"),))
    other = replace(turned, estimate=replace(turned.estimate, frf=frf))
    assert check(a_test([3], "a"), other)[0].scale == pytest.approx(-1.0, abs=0.01)


@pytest.mark.parametrize("shift", [0.0, 0.005])
def test_without_a_shared_channel_resonances_are_compared(shift):
    tests = (
        a_test([0, 1, 2], "a", noise=0.002),
        a_test([3, 4, 5], "b", system=drifted(shift), noise=0.002, seed=2),
    )
    (found,) = check(*tests)
    assert found.shared == ()
    assert found.excess is None
    assert found.poles >= 3
    assert found.shift == pytest.approx(shift, abs=1e-3)
    assert "share no channel" in found.sentence


def test_set_ups_without_anything_in_common_say_so():
    noise = a_test([3, 4], "b", noise=1e6, seed=3)
    (found,) = check(FIRST, noise)
    assert found.agrees is None or found.shift is not None
    if found.shift is None:
        assert "they share neither a channel nor a resonance" in found.sentence


def test_every_pair_of_one_hammer_place_is_compared():
    third = a_test([5, 0], "c", seed=4)
    elsewhere = a_test([0, 1], "d", reference=Dof.parse("acc1:+tx"), seed=5)
    found = check(FIRST, a_test([1, 2], "b", seed=2), third, elsewhere)
    assert [one.names for one in found] == [
        ("set-up a", "set-up b"),
        ("set-up a", "set-up c"),
        ("set-up b", "set-up c"),
    ]


def test_other_levels_and_speeds_are_no_set_ups():
    assert check(FIRST, a_test([0, 1], "b", level_n=40.0)) == ()
    assert check(FIRST, a_test([0, 1], "b", spindle_speed=6.0)) == ()


def test_two_tests_without_names_are_called_by_their_file():
    first, again = a_test([0], None), a_test([0], None, seed=2)
    (found,) = check(first, again)
    assert found.names == ("a.uff", "a.uff again")
