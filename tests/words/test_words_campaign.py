"""Campaigns, conditions, tolerances, errors: what they refuse and what they keep together."""

from dataclasses import fields, replace

import numpy as np
import pytest

from identification.words import (
    Campaign,
    Condition,
    ConvergenceError,
    Dof,
    Frf,
    FrfEstimate,
    InputError,
    Layout,
    Test,
    Tolerance,
    UsageError,
    WorkbenchError,
)

FREQ = np.array([1.0, 2.0, 4.0, 8.0])
OUTPUTS = tuple(Dof.of("acc1", axis) for axis in range(3))
LAYOUT = Layout(
    ("table",), np.zeros((1, 3)), ("acc1",), np.zeros(1), np.ones((1, 3)), np.eye(3)[None]
)


def an_estimate(reference, *, freq=FREQ, quantity="accelerance", scale=1.0):
    values = scale * np.arange(1, 3 * len(freq) + 1).reshape(len(freq), 3, 1) * (1 + 2j)
    return FrfEstimate(
        Frf(freq, values, OUTPUTS, (reference,), quantity),
        variance=np.abs(values),
        variance_source="differences",
        measured=np.ones((3, 1), bool),
    )


def a_test(label="acc1:+tx", *, file="impact.uff", **changed):
    reference = Dof.parse(label)
    return Test(Condition(file, reference, level_n=200.0), an_estimate(reference, **changed))


@pytest.mark.parametrize("level", [0.0, -1.0, np.nan, np.inf])
def test_a_level_that_is_no_force_is_refused(level):
    with pytest.raises(ValueError, match=f"level is {level} N, expected more than 0"):
        Condition("a.uff", OUTPUTS[0], level_n=level)


@pytest.mark.parametrize("speed", [np.nan, np.inf, -np.inf])
def test_a_spindle_speed_that_is_no_number_is_refused(speed):
    with pytest.raises(ValueError, match="spindle speed is"):
        Condition("a.uff", OUTPUTS[0], spindle_speed=speed)


def test_a_spindle_may_turn_backwards():
    assert Condition("a.uff", OUTPUTS[0], spindle_speed=-3.0).spindle_speed == -3.0


def test_a_level_may_be_unknown():
    assert Condition("a.uff", OUTPUTS[0]).level_n is None


def test_equal_conditions_are_one_key():
    assert len({Condition("a", OUTPUTS[0], 40.0), Condition("a", OUTPUTS[0], 40.0)}) == 1


@pytest.mark.parametrize("other", ["acc1:-tx", "acc1:+ty", "acc2:+tx"])
def test_a_test_whose_input_is_not_its_reference_is_refused(other):
    with pytest.raises(ValueError, match="are not the reference"):
        Test(Condition("a.uff", Dof.parse("acc1:+tx")), an_estimate(Dof.parse(other)))


def test_a_test_with_two_inputs_is_refused():
    inputs = (OUTPUTS[0], OUTPUTS[1])
    estimate = FrfEstimate(
        Frf(FREQ, np.ones((4, 3, 2)), OUTPUTS, inputs, "accelerance"),
        np.ones((4, 3, 2)),
        "coherence",
        np.ones((3, 2), bool),
    )
    with pytest.raises(ValueError, match="are not the reference"):
        Test(Condition("a.uff", OUTPUTS[0]), estimate)


@pytest.mark.parametrize("name", [field.name for field in fields(Tolerance)])
@pytest.mark.parametrize("value", [-1e-9, np.nan, np.inf])
def test_a_tolerance_that_is_no_spread_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"tolerance {name} is"):
        Tolerance(**{name: value})


@pytest.mark.parametrize("name", [field.name for field in fields(Tolerance)])
def test_a_number_may_be_known_exactly(name):
    exact = 1.0 if name in ("stiffness", "damping") else 0.0  # a factor of 1
    assert getattr(Tolerance(**{name: exact}), name) == exact


@pytest.mark.parametrize("name", ["stiffness", "damping"])
def test_a_factor_below_one_is_refused(name):
    with pytest.raises(ValueError, match=f"tolerance {name} is a factor of 0.5, below 1"):
        Tolerance(**{name: 0.5})


def test_default_tolerances_are_those_of_the_format():
    assert vars(Tolerance()) == {
        "mass": 0.02,
        "inertia": 0.05,
        "com": 0.003,
        "joint_position": 0.003,
        "sensor_gain": 0.01,
        "sensor_angle": 0.01745,
        "sensor_position": 0.0015,
        "hammer_angle": 0.01745,
        "hammer_position": 0.003,
        "sensor_delay": 2e-5,
        "sensor_cross": 0.014,
        "hammer_gain": 0.02,
        "hammer_delay": 2e-5,
        "stiffness": 3.0,
        "damping": 4.0,
    }


def test_a_campaign_without_a_test_is_refused():
    with pytest.raises(ValueError, match="at least one test"):
        Campaign("empty", LAYOUT, ())


@pytest.mark.parametrize("freq", [FREQ[:3], FREQ + 1e-9])
def test_a_test_on_another_frequency_axis_is_named(freq):
    with pytest.raises(ValueError, match=r"other\.uff has another frequency axis"):
        Campaign("c", LAYOUT, (a_test(), a_test("acc1:+ty", file="other.uff", freq=freq)))


def test_a_test_in_another_quantity_is_named():
    with pytest.raises(ValueError, match=r"other\.uff holds mobility, not accelerance"):
        Campaign("c", LAYOUT, (a_test(), a_test(file="other.uff", quantity="mobility")))


def test_the_axis_of_a_campaign_is_that_of_its_tests():
    campaign = Campaign("c", LAYOUT, [a_test(), a_test("acc1:-tz", scale=2.0)])
    np.testing.assert_array_equal(campaign.freq_hz, FREQ)
    assert isinstance(campaign.tests, tuple)


@pytest.mark.parametrize("chosen", [slice(1, 3), np.array([False, True, True, False])])
def test_lines_are_kept_in_every_test(chosen):
    whole = Campaign("c", LAYOUT, (a_test(), a_test("acc1:-tz", scale=2.0)), Tolerance(mass=0.5))
    kept = whole.select_lines(chosen)
    np.testing.assert_array_equal(kept.freq_hz, [2.0, 4.0])
    for before, after in zip(whole.tests, kept.tests, strict=True):
        assert after.condition == before.condition
        np.testing.assert_array_equal(after.estimate.frf.values, before.estimate.frf.values[[1, 2]])
        np.testing.assert_array_equal(after.estimate.variance, before.estimate.variance[[1, 2]])
    assert kept.tolerance == whole.tolerance


def test_a_campaign_changed_by_replace_is_checked_again():
    with pytest.raises(ValueError, match="at least one test"):
        replace(Campaign("c", LAYOUT, (a_test(),)), tests=())


@pytest.mark.parametrize(
    ("kind", "code"),
    [(WorkbenchError, 1), (UsageError, 2), (InputError, 3), (ConvergenceError, 4)],
)
def test_each_error_has_its_exit_code(kind, code):
    assert issubclass(kind, WorkbenchError)
    assert kind("x").exit_code == code
