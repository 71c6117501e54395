"""Coordinates of what varies: scales, priors, bounds, and what a user may wish of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_machine import TOLERANCE, one

from identification.words import Tolerance
from mbmodel import Model, body_parts
from tuning import freedom, with_tolerances
from tuning.parametrisation.parametrisation import BOUND
from tuning.solvers.gauss_newton import LARGEST_STEP


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_coordinates_and_theta_are_inverse(made, seed):
    x = np.random.default_rng(seed).uniform(-2.4, 2.4, made.size)
    np.testing.assert_allclose(made.coordinates(made.theta(x)), x, rtol=1e-9, atol=1e-9)


def test_the_drawing_is_where_all_coordinates_are_zero(whole, made):
    assert np.array_equal(made.theta(np.zeros(made.size)), whole.drawn)
    assert np.array_equal(made.coordinates(whole.drawn), np.zeros(made.size))


def test_what_the_drawing_knows_exactly_has_no_coordinate(whole, made):
    exact = [p.name for p, free in zip(whole.parameters, made.free, strict=True) if not free]
    assert exact == [f"{s}.joint_rotation_{a}" for s in ("base", "head") for a in "xyz"]
    x = np.random.default_rng(2).normal(size=made.size)
    assert np.array_equal(made.theta(x)[~made.free], whole.drawn[~made.free])


def test_sizes_move_by_factors_and_all_else_along_a_line(made, place):
    stiffness, mass, com = "base_tz.stiffness", "head.mass", "head.com_y"
    assert made.theta(one(made, place, stiffness, 0.7))[place(stiffness)] == pytest.approx(
        9e7 * np.exp(0.7), rel=1e-14
    )
    assert made.theta(one(made, place, mass, -1.5))[place(mass)] == pytest.approx(
        35 * np.exp(-1.5 * 0.021), rel=1e-14
    )
    assert made.theta(one(made, place, com, -1.5))[place(com)] == pytest.approx(
        -1.5 * 0.0031, rel=1e-14
    )


def test_pulls_count_the_standard_deviations_of_their_own_tolerance(whole, made, place):
    # One of each kind; a coordinate of one is one tolerance, relative of sizes.
    for name, tolerance in (
        ("base.mass", TOLERANCE.mass),
        ("head.inertia_yy", TOLERANCE.inertia),
        ("base.com_z", TOLERANCE.com),
        ("base.joint_position_x", TOLERANCE.joint_position),
        ("acc4.gain_z", TOLERANCE.sensor_gain),
        ("acc2.rotation_y", TOLERANCE.sensor_angle),
        ("acc6.position_x", TOLERANCE.sensor_position),
        ("hammer(acc3:tx).rotation_z", TOLERANCE.hammer_angle),
        ("hammer(acc5:tz).position_y", TOLERANCE.hammer_position),
    ):
        moved = made.theta(one(made, place, name, 1.0))[place(name)]
        drawn = whole.drawn[place(name)]
        pull = np.log(moved / drawn) if drawn else moved
        assert pull == pytest.approx(tolerance, rel=1e-12), name
        assert made.has_prior[made.member[place(name)]], name


def test_a_product_of_inertia_is_known_relative_to_its_own_size(whole, made, place):
    for name, drawn in (("base.inertia_xz", -0.2), ("head.inertia_yz", 0.06)):
        assert whole.drawn[place(name)] == pytest.approx(drawn, rel=1e-9)
        moved = made.theta(one(made, place, name, 1.0))[place(name)]
        assert moved - drawn == pytest.approx(TOLERANCE.inertia * abs(drawn), rel=1e-9)


def test_a_product_of_inertia_that_the_drawing_does_not_have_stays_zero(model):
    symmetric = freedom(Model(model.machine, body_parts(model.machine)), TOLERANCE)
    assert not any(name.endswith(("_xy", "_xz", "_yz")) for name in symmetric.names)


def test_rates_are_the_differences_of_theta(made):
    x = np.random.default_rng(3).uniform(-2, 2, made.size)
    step = 1e-6
    for k in range(made.size):
        unit = np.zeros(made.size)
        unit[k] = step
        slope = (made.theta(x + unit) - made.theta(x - unit)) / (2 * step)
        own = made.member == k
        np.testing.assert_allclose(slope[own], made.rates(x)[own], rtol=1e-8)
        assert not slope[~own].any()
    assert not made.rates(x)[~made.free].any()


def test_tolerances_are_kept_within_2_5_of_them_and_the_rest_within_a_factor_of_100(made):
    assert BOUND == 2.5
    widest = np.where(made.has_prior, 2.5, np.log(100))
    np.testing.assert_allclose(made.upper, widest, rtol=1e-15)
    np.testing.assert_allclose(made.lower, -widest, rtol=1e-15)
    springs = [name.endswith((".stiffness", ".damping")) for name in made.names]
    assert np.array_equal(made.has_prior, ~np.array(springs))


def test_without_bounds_tolerances_are_free_and_the_rest_is_kept(made):
    loose = made.unbounded()
    assert np.isinf(loose.upper[loose.has_prior]).all()
    assert np.isinf(loose.lower[loose.has_prior]).all()
    known = ~made.has_prior
    assert np.array_equal(loose.upper[known], made.upper[known])
    assert np.array_equal(loose.lower[known], made.lower[known])


def test_some_coordinates_only_leave_the_others_where_x_has_them(made):
    random = np.random.default_rng(4)
    x, chosen = random.uniform(-2, 2, made.size), random.random(made.size) < 0.4
    part = made.only(chosen, x)
    other = random.uniform(-2, 2, int(chosen.sum()))
    moved = x.copy()
    moved[chosen] = other
    np.testing.assert_allclose(part.theta(other), made.theta(moved), rtol=1e-14)
    np.testing.assert_allclose(part.coordinates(made.theta(moved)), other, rtol=1e-9, atol=1e-9)
    assert part.names == tuple(np.array(made.names)[chosen])
    for name in ("has_prior", "lower", "upper"):
        assert np.array_equal(getattr(part, name), getattr(made, name)[chosen])


def test_derivatives_by_theta_are_collected_along_the_coordinates(made):
    random = np.random.default_rng(5)
    x, slope = random.uniform(-1, 1, made.size), random.normal(size=len(made.parameters))
    dense = np.zeros((len(made.parameters), made.size))
    for parameter, coordinate in enumerate(made.member):
        if coordinate >= 0:
            dense[parameter, coordinate] = made.rates(x)[parameter]
    np.testing.assert_allclose(made.collected(slope, x), dense.T @ slope, rtol=1e-13)


def test_a_tolerance_of_zero_means_exactly(whole, place):
    made = freedom(whole, Tolerance(mass=0.0, sensor_angle=0.0))
    gone = [p.known in ("mass", "sensor_angle", "exactly") for p in whole.parameters]
    assert np.array_equal(made.free, ~np.array(gone))


def test_parameters_at_a_bound_are_named_and_others_are_not(made, place):
    x = np.zeros(made.size)
    x[made.member[place("acc3.gain_y")]] = 2.5
    x[made.member[place("base_tx.damping")]] = -np.log(100) + 1e-9
    x[made.member[place("acc3.gain_z")]] = 2.49
    at = made.at_bound(x)
    assert set(np.flatnonzero(at)) == {place("acc3.gain_y"), place("base_tx.damping")}


def test_released_tolerances_have_no_prior_and_no_bound(model, campaign):
    whole = with_tolerances(model.machine, campaign)
    varies = freedom(whole, campaign.tolerance)
    names = ("acc3.rotation_x", "acc3.rotation_y")
    free = varies.released(names)
    for k, name in enumerate(varies.names):
        released = name in names
        assert free.has_prior[k] == (varies.has_prior[k] and not released)
        assert np.isinf(free.upper[k]) == released
    assert np.array_equal(free.scale, varies.scale)


def test_a_released_gain_takes_steps_of_a_size_and_not_of_its_tolerance(made, place):
    name = "acc1.gain_x"
    free = made.released([name])
    own = made.member[place(name)]
    assert free.scales[own] == pytest.approx(TOLERANCE.sensor_gain)
    x = np.zeros(free.size)
    x[own] = LARGEST_STEP / free.scales[own]
    assert free.theta(x)[place(name)] == pytest.approx(np.exp(LARGEST_STEP))
    assert (free.scales[~free.has_prior & (np.arange(free.size) != own)] == 1).all()


def test_sizes_that_vary_by_themselves_move_along_a_line_as_far_as_before(whole, wish, place):
    names = ["base_tx.stiffness", "base_tz.damping", "acc1.rotation_x"]
    usual = wish(prior={"base_tz.*": 0.3}, ties=[["base_tx.stiffness", "head_tx.stiffness"]])
    made = usual.linear(names)
    rng = np.random.default_rng(5)
    x = rng.uniform(-0.4, 0.4, made.size)
    np.testing.assert_allclose(made.coordinates(made.theta(x)), x, atol=1e-9)
    # By factors of 1 + scale x, of tied ones the same; all else as before.
    moved = {"base_tx.stiffness": 1.0, "head_tx.stiffness": 1.0, "base_tz.damping": 0.3}
    for name, scale in moved.items():
        own = place(name)
        assert made.theta(x)[own] == pytest.approx(
            whole.drawn[own] * (1 + scale * x[made.member[own]])
        )
    rest = [k for k, parameter in enumerate(whole.parameters) if parameter.name not in moved]
    np.testing.assert_array_equal(made.theta(x)[rest], usual.theta(x)[rest])
    # The bounds are the same sizes; rates those near the drawing.
    for name in ("base_tx.stiffness", "base_tz.damping"):
        own = usual.member[place(name)]
        for ends in ("lower", "upper"):
            sizes = []
            for varies in (usual, made):
                far = np.zeros(varies.size)
                far[own] = getattr(varies, ends)[own]
                sizes.append(varies.theta(far)[place(name)])
            assert sizes[0] == pytest.approx(sizes[1])
    np.testing.assert_allclose(made.rates(0 * x), usual.rates(0 * x))
    assert not made.is_logarithm[made.member[place("base_tx.stiffness")]]
    # With further Parts they still do.
    more = made.extended(freedom(whole, TOLERANCE))
    np.testing.assert_array_equal(more.theta(x), made.theta(x))
