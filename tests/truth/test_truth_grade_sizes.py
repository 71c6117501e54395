"""Sizes and intervals against the truth."""

import pytest

from truth.grade.answer import TrueCause, Truth
from truth.grade.rates import wilson
from truth.grade.sizes import estimates_of, sizes_of
from truth.grade.verdict import NOTHING_SAID, Row, StatedVerdict


def truth_of(effect, location, **parameters):
    return Truth((TrueCause(effect, location, parameters=parameters),))


def stated(effect, location, parameters, interval=None):
    row = Row(effect, location, 0.9, parameters=parameters, interval=interval or {})
    return StatedVerdict("explained", causes=(Row("drift", "joint:x", 0.95), row))


APPENDAGE = truth_of("appendage", "body:ty", mass=(20.0,), frequency=(50.0,))


def test_the_error_of_a_scalar_is_relative():
    verdict = stated("appendage", "body:ty", {"mass": (25.0,), "frequency": (40.0,)})
    mass, frequency = estimates_of(APPENDAGE, verdict)
    assert (mass.error, mass.size_error, mass.is_size) == (0.25, 0.25, True)
    assert (frequency.error, frequency.size_error, frequency.is_size) == (0.2, None, False)


def test_the_error_of_a_vector_is_that_of_the_difference():
    truth = truth_of("sensor_position", "sensor:a", offset=(0.0, 0.03, 0.04))
    verdict = stated("sensor_position", "sensor:a", {"offset": (0.02, 0.03, 0.04)})
    assert estimates_of(truth, verdict)[0].error == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("effect", "location", "name"),
    [("sensor_gain", "sensor:a", "gain"), ("drift", "joint:ty", "factor")],
)
def test_a_factor_counts_from_one_as_a_size(effect, location, name):
    truth = truth_of(effect, location, **{name: (1.1,)})
    (one,) = estimates_of(truth, StatedVerdict("explained", causes=(
        Row(effect, location, 0.9, parameters={name: (1.0,)}),)))  # fmt: skip
    assert one.error == pytest.approx(0.1 / 1.1)
    assert one.size_error == pytest.approx(1.0)


def test_a_support_that_is_lost_counts_by_what_it_lost():
    truth = truth_of("support_loss", "joint:ty", fraction=(0.2, 1.0, 1.0, 0.2))
    verdict = stated("support_loss", "joint:ty", {"fraction": (0.6, 1.0, 1.0, 0.6)})
    assert estimates_of(truth, verdict)[0].size_error == pytest.approx(0.5)


@pytest.mark.parametrize(
    "verdict",
    [
        NOTHING_SAID,
        stated("appendage", "body:tilt", {"mass": (20.0,)}),
        stated("mass_error", "body:ty", {"mass": (20.0,)}),
        stated("appendage", "body:ty", {}),
        stated("appendage", "body:ty", {"mass": (20.0, 1.0)}, {"mass": ((0, 30), (0, 30))}),
    ],
)
def test_what_is_not_estimated_has_no_error_but_counts_as_true(verdict):
    mass = estimates_of(APPENDAGE, verdict)[0]
    assert (mass.error, mass.size_error, mass.inside) == (None, None, ())
    errors = sizes_of(estimates_of(APPENDAGE, verdict)).size_of["appendage"]
    assert (errors.true, errors.n, errors.median) == (1, 0, None)


def test_a_truth_of_zero_has_no_relative_error():
    truth = truth_of("mass_error", "body:ty", position=(0.0, 0.0, 0.0))
    verdict = stated("mass_error", "body:ty", {"position": (0.1, 0.0, 0.0)})
    assert estimates_of(truth, verdict)[0].error is None


def test_intervals_are_counted_for_each_component():
    truth = truth_of("joint_coupling", "joint:ty", offset=(1.0, 2.0, 3.0))
    verdict = stated(
        "joint_coupling",
        "joint:ty",
        {"offset": (1.0, 2.0, 9.0)},
        {"offset": ((0.5, 1.0), (2.1, 3.0), (2.0, 4.0))},
    )
    estimates = estimates_of(truth, verdict)
    assert estimates[0].inside == (True, False, True)
    rate = sizes_of(estimates).intervals
    assert (rate.n, rate.hits, (rate.low, rate.high)) == (3, 2, wilson(2, 3))


def test_intervals_are_counted_by_effect():
    mass = stated("appendage", "body:ty", {"mass": (20.0,)}, {"mass": ((19.0, 21.0),)})
    gain = stated("sensor_gain", "sensor:a", {"gain": (1.2,)}, {"gain": ((1.1, 1.2),)})
    truth = truth_of("sensor_gain", "sensor:a", gain=(1.3,))
    held = sizes_of([*estimates_of(APPENDAGE, mass), *estimates_of(truth, gain)]).intervals_of
    assert {name: (rate.n, rate.hits) for name, rate in held.items()} == {
        "appendage": (1, 1),
        "sensor_gain": (1, 0),
    }


def test_of_several_effects_each_is_estimated_and_an_unknown_one_is_not():
    truth = Truth(
        (
            TrueCause("mass_error", "body:ty", parameters={"mass": (10.0,)}),
            TrueCause("unexplained", "joint:ty", parameters={"inertance": (3.0,)}),
        )
    )
    (one,) = estimates_of(truth, stated("mass_error", "body:ty", {"mass": (5.0,)}))
    assert (one.effect, one.error) == ("mass_error", 0.5)


def test_errors_are_summed_up_by_effect_and_parameter():
    estimates = [
        one
        for mass in (20.0, 22.0, 30.0)
        for one in estimates_of(APPENDAGE, stated("appendage", "body:ty", {"mass": (mass,)}))
    ]
    sizes = sizes_of(estimates)
    assert sizes.size == sizes.size_of["appendage"] == sizes.parameters["appendage"]["mass"]
    assert (sizes.size.true, sizes.size.n) == (3, 3)
    assert sizes.size.median == pytest.approx(0.1)
    assert sizes.size.ninety == pytest.approx(0.42)
    assert sizes.parameters["appendage"]["frequency"].n == 0
    assert sizes.intervals.n == 0
