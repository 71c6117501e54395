"""Coordinates of what varies: scales, priors, bounds, and what a user may wish of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_machine import TOLERANCE, unit_coordinate

from identification.words import TOLERANCE_BOUND_SIGMA
from mbmodel import Model, body_parts
from tuning import build_toleranced_model, parametrise
from tuning.solvers.gauss_newton import LARGEST_STEP


@given(st.integers(0, 2**32 - 1))
def test_coordinates_and_theta_are_inverse(toleranced, seed):
    x = np.random.default_rng(seed).uniform(-2.4, 2.4, toleranced.size)
    np.testing.assert_allclose(toleranced.coordinates(toleranced.theta(x)), x, rtol=1e-9, atol=1e-9)


def test_the_drawing_is_where_all_coordinates_are_zero(whole, toleranced):
    assert np.array_equal(toleranced.theta(np.zeros(toleranced.size)), whole.drawn)
    assert np.array_equal(toleranced.coordinates(whole.drawn), np.zeros(toleranced.size))


def test_what_the_drawing_knows_exactly_has_no_coordinate(whole, toleranced):
    exact = [p.name for p, free in zip(whole.parameters, toleranced.free, strict=True) if not free]
    assert exact == [f"{s}.joint_rotation_{a}" for s in ("base", "head") for a in "xyz"]
    x = np.random.default_rng(2).normal(size=toleranced.size)
    assert np.array_equal(toleranced.theta(x)[~toleranced.free], whole.drawn[~toleranced.free])


def test_sizes_move_by_factors_and_all_else_along_a_line(toleranced, place):
    stiffness, mass, com = "base_tz.stiffness", "head.mass", "head.com_y"
    assert toleranced.theta(unit_coordinate(toleranced, place, stiffness, 0.7))[
        place(stiffness)
    ] == pytest.approx(9e7 * np.exp(0.7), rel=1e-14)
    assert toleranced.theta(unit_coordinate(toleranced, place, mass, -1.5))[
        place(mass)
    ] == pytest.approx(35 * np.exp(-1.5 * 0.021), rel=1e-14)
    assert toleranced.theta(unit_coordinate(toleranced, place, com, -1.5))[
        place(com)
    ] == pytest.approx(-1.5 * 0.0031, rel=1e-14)


def test_pulls_count_the_standard_deviations_of_their_own_tolerance(whole, toleranced, place):
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
        moved = toleranced.theta(unit_coordinate(toleranced, place, name, 1.0))[place(name)]
        drawn = whole.drawn[place(name)]
        pull = np.log(moved / drawn) if drawn else moved
        assert pull == pytest.approx(tolerance, rel=1e-12), name
        assert toleranced.is_tolerance[toleranced.coordinate_of[place(name)]], name


def test_a_product_of_inertia_is_known_relative_to_its_own_size(whole, toleranced, place):
    for name, drawn in (("base.inertia_xz", -0.2), ("head.inertia_yz", 0.06)):
        assert whole.drawn[place(name)] == pytest.approx(drawn, rel=1e-9)
        moved = toleranced.theta(unit_coordinate(toleranced, place, name, 1.0))[place(name)]
        assert moved - drawn == pytest.approx(TOLERANCE.inertia * abs(drawn), rel=1e-9)


def test_a_product_of_inertia_that_the_drawing_does_not_have_stays_zero(model):
    symmetric = parametrise(Model(model.machine, body_parts(model.machine)), TOLERANCE)
    assert not any(name.endswith(("_xy", "_xz", "_yz")) for name in symmetric.names)


def test_rates_are_the_differences_of_theta(toleranced):
    x = np.random.default_rng(3).uniform(-2, 2, toleranced.size)
    step = 1e-6
    for k in range(toleranced.size):
        unit = np.zeros(toleranced.size)
        unit[k] = step
        slope = (toleranced.theta(x + unit) - toleranced.theta(x - unit)) / (2 * step)
        own_rows = toleranced.coordinate_of == k
        np.testing.assert_allclose(slope[own_rows], toleranced.rates(x)[own_rows], rtol=1e-8)
        assert not slope[~own_rows].any()
    assert not toleranced.rates(x)[~toleranced.free].any()


def test_tolerances_are_kept_within_2_5_of_them_and_the_rest_within_a_factor_of_100(toleranced):
    assert TOLERANCE_BOUND_SIGMA == 2.5
    widest = np.where(toleranced.is_tolerance, 2.5, np.log(100))
    np.testing.assert_allclose(toleranced.upper, widest, rtol=1e-15)
    np.testing.assert_allclose(toleranced.lower, -widest, rtol=1e-15)
    springs = [name.endswith((".stiffness", ".damping")) for name in toleranced.names]
    assert np.array_equal(toleranced.is_tolerance, ~np.array(springs))


def test_without_bounds_tolerances_are_free_and_the_rest_is_kept(toleranced):
    loose = toleranced.lift_bounds()
    assert np.isinf(loose.upper[loose.is_tolerance]).all()
    assert np.isinf(loose.lower[loose.is_tolerance]).all()
    is_free = ~toleranced.is_tolerance
    assert np.array_equal(loose.upper[is_free], toleranced.upper[is_free])
    assert np.array_equal(loose.lower[is_free], toleranced.lower[is_free])


def test_some_coordinates_only_leave_the_others_where_x_has_them(toleranced):
    random = np.random.default_rng(4)
    x, chosen = random.uniform(-2, 2, toleranced.size), random.random(toleranced.size) < 0.4
    part = toleranced.restrict(chosen, x)
    second = random.uniform(-2, 2, int(chosen.sum()))
    moved = x.copy()
    moved[chosen] = second
    np.testing.assert_allclose(part.theta(second), toleranced.theta(moved), rtol=1e-14)
    np.testing.assert_allclose(
        part.coordinates(toleranced.theta(moved)), second, rtol=1e-9, atol=1e-9
    )
    assert part.names == tuple(np.array(toleranced.names)[chosen])
    for name in ("is_tolerance", "lower", "upper"):
        assert np.array_equal(getattr(part, name), getattr(toleranced, name)[chosen])


def test_derivatives_by_theta_are_collected_along_the_coordinates(toleranced):
    random = np.random.default_rng(5)
    x, slope = (
        random.uniform(-1, 1, toleranced.size),
        random.normal(size=len(toleranced.parameters)),
    )
    dense = np.zeros((len(toleranced.parameters), toleranced.size))
    for parameter, coordinate in enumerate(toleranced.coordinate_of):
        if coordinate >= 0:
            dense[parameter, coordinate] = toleranced.rates(x)[parameter]
    np.testing.assert_allclose(
        toleranced.gradient_by_coordinates(slope, x), dense.T @ slope, rtol=1e-13
    )


def test_a_tolerance_of_zero_means_exactly(whole, place):
    toleranced = parametrise(whole, replace(TOLERANCE, mass=0.0, sensor_angle=0.0))
    gone = [p.known in ("mass", "sensor_angle", "exactly") for p in whole.parameters]
    assert np.array_equal(toleranced.free, ~np.array(gone))


def test_parameters_at_a_bound_are_named_and_others_are_not(toleranced, place):
    x = np.zeros(toleranced.size)
    x[toleranced.coordinate_of[place("acc3.gain_y")]] = 2.5
    x[toleranced.coordinate_of[place("base_tx.damping")]] = -np.log(100) + 1e-9
    x[toleranced.coordinate_of[place("acc3.gain_z")]] = 2.49
    at = toleranced.parameters_at_bound(x)
    assert set(np.flatnonzero(at)) == {place("acc3.gain_y"), place("base_tx.damping")}


def test_released_tolerances_have_no_prior_and_no_bound(model, campaign):
    whole = build_toleranced_model(model.machine, campaign)
    parametrisation = parametrise(whole, campaign.tolerance)
    names = ("acc3.rotation_x", "acc3.rotation_y")
    free = parametrisation.release_priors(names)
    for k, name in enumerate(parametrisation.names):
        released = name in names
        assert free.is_tolerance[k] == (parametrisation.is_tolerance[k] and not released)
        assert np.isinf(free.upper[k]) == released
    assert np.array_equal(free.scale, parametrisation.scale)


def test_a_released_gain_takes_steps_of_a_size_and_not_of_its_tolerance(toleranced, place):
    name = "acc1.gain_x"
    free = toleranced.release_priors([name])
    own_rows = toleranced.coordinate_of[place(name)]
    assert free.scales[own_rows] == pytest.approx(TOLERANCE.sensor_gain)
    x = np.zeros(free.size)
    x[own_rows] = LARGEST_STEP / free.scales[own_rows]
    assert free.theta(x)[place(name)] == pytest.approx(np.exp(LARGEST_STEP))
    assert (free.scales[~free.is_tolerance & (np.arange(free.size) != own_rows)] == 1).all()


def test_sizes_that_vary_by_themselves_move_along_a_line_as_far_as_before(whole, specify, place):
    names = ["base_tx.stiffness", "base_tz.damping", "acc1.rotation_x"]
    usual = specify(prior={"base_tz.*": 0.3}, ties=[["base_tx.stiffness", "head_tx.stiffness"]])
    toleranced = usual.vary_linearly(names)
    rng = np.random.default_rng(5)
    x = rng.uniform(-0.4, 0.4, toleranced.size)
    np.testing.assert_allclose(toleranced.coordinates(toleranced.theta(x)), x, atol=1e-9)
    # By factors of 1 + scale x, of tied ones the same; all else as before.
    moved = {"base_tx.stiffness": 1.0, "head_tx.stiffness": 1.0, "base_tz.damping": 0.3}
    for name, scale in moved.items():
        own_rows = place(name)
        assert toleranced.theta(x)[own_rows] == pytest.approx(
            whole.drawn[own_rows] * (1 + scale * x[toleranced.coordinate_of[own_rows]])
        )
    rest = [k for k, parameter in enumerate(whole.parameters) if parameter.name not in moved]
    np.testing.assert_array_equal(toleranced.theta(x)[rest], usual.theta(x)[rest])
    # The bounds are the same sizes; rates those near the drawing.
    for name in ("base_tx.stiffness", "base_tz.damping"):
        own_rows = usual.coordinate_of[place(name)]
        for ends in ("lower", "upper"):
            sizes = []
            for parametrisation in (usual, toleranced):
                far = np.zeros(parametrisation.size)
                far[own_rows] = getattr(parametrisation, ends)[own_rows]
                sizes.append(parametrisation.theta(far)[place(name)])
            assert sizes[0] == pytest.approx(sizes[1])
    np.testing.assert_allclose(toleranced.rates(0 * x), usual.rates(0 * x))
    assert not toleranced.is_logarithmic[toleranced.coordinate_of[place("base_tx.stiffness")]]
    # With further Parts they still do.
    more = toleranced.extend(parametrise(whole, TOLERANCE))
    np.testing.assert_array_equal(more.theta(x), toleranced.theta(x))


def test_a_parameter_that_follows_a_linear_one_is_linear(toleranced):
    names = [name for name in toleranced.names if name.endswith(".stiffness")][:2]
    tied = toleranced.vary_linearly(names[:1]).tie_parameters({names[1]: names[0]})
    x = np.zeros(tied.size)
    x[list(tied.names).index(names[0])] = 2.0
    theta = dict(zip((p.name for p in tied.parameters), tied.theta(x), strict=True))
    assert theta[names[1]] == theta[names[0]]


def test_sizes_far_astray_stay_finite_and_positive(parametrisation):
    logarithmic = np.array([parameter.positive for parameter in parametrisation.parameters])
    for end in (-1e6, 1e6):
        theta = parametrisation.theta(np.full(parametrisation.size, end))
        assert np.isfinite(theta).all()
        sizes = theta[logarithmic & (parametrisation.fixed > 0)]
        assert (sizes > 0).all()
