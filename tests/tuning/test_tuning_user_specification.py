"""What a user may wish of what varies: freed, fixed, priors, bounds, ties, and what is refused."""

import numpy as np
import pytest
from small_machine import TOLERANCE, unit_coordinate

from identification.words import InputError
from tuning import UserSpecification, build_toleranced_model, parametrise, random_starts


def test_freed_parameters_have_neither_prior_nor_narrow_bounds(toleranced, specify, place):
    freed = specify(free=["acc?.gain_x", "head.com_z", "base.joint_rotation_y"])
    for number in range(1, 7):
        coordinate = freed.coordinate_of[place(f"acc{number}.gain_x")]
        assert not freed.is_tolerance[coordinate]
        assert freed.upper[coordinate] == pytest.approx(np.log(100))
        assert freed.lower[coordinate] == pytest.approx(-np.log(100))
    # What is no size has no factor: one in SI, unbounded.
    for name in ("head.com_z", "base.joint_rotation_y"):
        moved = freed.theta(unit_coordinate(freed, place, name, 0.02))[place(name)]
        assert moved == pytest.approx(0.02, rel=1e-14)
        assert freed.upper[freed.coordinate_of[place(name)]] == np.inf
    assert freed.size == toleranced.size + 1
    assert freed.is_tolerance.sum() == toleranced.is_tolerance.sum() - 7


def test_fixed_parameters_stay_as_drawn(whole, toleranced, specify, place):
    fixed = specify(fix=["base_*.damping", "hammer(acc3:ty).*"])
    gone = toleranced.free & ~fixed.free
    names = [whole.parameters[k].name for k in np.flatnonzero(gone)]
    assert len(names) == 3 + 6
    assert all(name.startswith(("base_", "hammer(acc3:ty)")) for name in names)
    x = np.full(fixed.size, 1.3)
    assert np.array_equal(fixed.theta(x)[gone], whole.drawn[gone])


def test_a_prior_is_one_standard_deviation_about_the_drawing(specify, place):
    priors = specify(prior={"head_*.stiffness": 0.3, "base.joint_rotation_z": 0.004})
    for name, moved in (("head_ty.stiffness", 6e6 * np.exp(0.3)), ("base.joint_rotation_z", 0.004)):
        coordinate = priors.coordinate_of[place(name)]
        assert priors.theta(unit_coordinate(priors, place, name, 1.0))[
            place(name)
        ] == pytest.approx(moved)
        assert priors.is_tolerance[coordinate]
        assert (priors.lower[coordinate], priors.upper[coordinate]) == (-2.5, 2.5)
    assert not priors.is_tolerance[priors.coordinate_of[place("base_tx.stiffness")]]


def test_bounds_are_given_in_si(specify, place):
    bounds = {
        "head_tx.stiffness": (5e6, 2.4e7),
        "head.mass": (34.0, 36.5),
        "acc?.rotation_z": (-0.03, 0.5),
    }
    bounded = specify(bounds=bounds)
    names = ("head_tx.stiffness", "head.mass", "acc1.rotation_z", "acc6.rotation_z")
    for side, ends in ((0, bounded.lower), (1, bounded.upper)):
        theta = bounded.theta(ends)
        for name in names:
            wanted = bounds.get(name, bounds["acc?.rotation_z"])[side]
            assert theta[place(name)] == pytest.approx(wanted, rel=1e-12), name
    assert (bounded.upper == 2.5).sum() == bounded.is_tolerance.sum() - 7


def test_tied_parameters_share_one_factor_on_what_is_drawn(whole, toleranced, specify, place):
    legs = ("base_tx.stiffness", "base_tz.stiffness", "head_tx.stiffness")
    tied = specify(ties=[[legs[0], "base_tz.stiff*", legs[2]], ["head_t?.damping"]])
    assert tied.size == toleranced.size - 3
    theta = tied.theta(unit_coordinate(tied, place, legs[2], 0.4))
    moved = np.flatnonzero(theta != whole.drawn)
    assert set(moved) == {place(name) for name in legs}
    np.testing.assert_allclose(theta[moved] / whole.drawn[moved], np.exp(0.4), rtol=1e-14)
    assert tied.names[: tied.size] == tuple(
        name for name in toleranced.names if name not in (*legs[1:], "head_ty.damping")
    )


def test_displacements_that_are_tied_share_one_displacement(specify, place):
    tied = specify(ties=[["acc?.position_x"]])
    theta = tied.theta(unit_coordinate(tied, place, "acc4.position_x", 2.0))
    places = [place(f"acc{k}.position_x") for k in range(1, 7)]
    np.testing.assert_allclose(theta[places], 2 * TOLERANCE.sensor_position, rtol=1e-14)


def test_ties_that_overlap_are_one(specify, place):
    tied = specify(ties=[["acc1.gain_x", "acc2.gain_x"], ["acc2.gain_x", "acc3.gain_x"]])
    assert len({int(tied.coordinate_of[place(f"acc{k}.gain_x")]) for k in (1, 2, 3)}) == 1


def test_a_tie_keeps_what_all_its_bounds_allow(specify, place):
    tied = specify(
        bounds={"base_tx.stiffness": (2e7, 5e7), "base_tz.stiffness": (8e7, 2.7e8)},
        ties=[["base_tx.stiffness", "base_tz.stiffness"]],
    )
    coordinate = tied.coordinate_of[place("base_tx.stiffness")]
    assert tied.upper[coordinate] == pytest.approx(np.log(5 / 3))
    assert tied.lower[coordinate] == pytest.approx(np.log(8 / 9))


def test_the_coordinate_of_tied_parameters_is_their_mean(whole, specify, place):
    tied = specify(ties=[["base_tx.stiffness", "base_tz.stiffness"]])
    theta = whole.drawn.copy()
    theta[place("base_tx.stiffness")] *= np.exp(0.1)
    theta[place("base_tz.stiffness")] *= np.exp(0.5)
    x = tied.coordinates(theta)
    assert x[tied.coordinate_of[place("base_tx.stiffness")]] == pytest.approx(0.3)
    assert np.count_nonzero(np.abs(x) > 1e-12) == 1


@pytest.mark.parametrize(
    "specification",
    [
        {"free": ["base_tx.stifness"]},
        {"fix": ["base_tx.stifness"]},
        {"prior": {"base_tx.stifness": 0.1}},
        {"bounds": {"base_tx.stifness": (1e7, 1e8)}},
        {"ties": [["base_tz.stiffness", "base_tx.stifness"]]},
    ],
    ids=lambda specification: next(iter(specification)),
)
def test_a_pattern_that_fits_nothing_is_refused_with_the_nearest_name(specify, specification):
    with pytest.raises(InputError, match=r"fits no parameter: did you mean base_tx\.stiffness\?"):
        specify(**specification)


def test_what_is_freed_and_fixed_is_refused_by_name(specify):
    with pytest.raises(
        InputError, match=r"acc5\.gain_y stands under two of free, fix and prior: choose one"
    ):
        specify(free=["acc?.gain_y"], fix=["acc5.*"])


@pytest.mark.parametrize("deviation", [0.0, -0.1, np.nan])
def test_a_prior_of_nothing_is_refused(specify, deviation):
    with pytest.raises(InputError, match=r"prior of head\.mass is .*: give more than 0"):
        specify(prior={"head.mass": deviation})


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("head.mass", (36.0, 40.0)),
        ("head.mass", (30.0, 34.0)),
        ("head.mass", (40.0, 30.0)),
        ("head.mass", (35.0, 35.0)),
        ("head.mass", (0.0, 40.0)),
        ("head.mass", (np.nan, 40.0)),
        ("head.com_x", (0.001, 0.01)),
        ("head.com_x", (-0.01, -0.001)),
    ],
)
def test_bounds_that_do_not_hold_the_drawn_value_are_refused(specify, name, ends):
    with pytest.raises(InputError, match=rf"bounds of {name} are .* give a lower and a higher"):
        specify(bounds={name: ends})


@pytest.mark.parametrize(
    ("tie", "more"),
    [
        (["base_tx.stiffness", "base_tx.damping"], {}),
        (["base_tx.stiffness", "base_ry.stiffness"], {}),
        (["base.mass", "acc1.gain_x"], {}),
        (["acc1.rotation_x", "hammer(acc3:tx).rotation_x"], {}),
        (["acc1.gain_x", "acc2.gain_x"], {"fix": ["acc2.gain_x"]}),
        (["acc1.gain_x", "acc2.gain_x"], {"free": ["acc1.gain_x"]}),
        (["acc1.gain_x", "acc2.gain_x"], {"free": ["acc1.gain_x"], "prior": {"acc2.gain_x": 1.0}}),
        (["acc1.gain_x", "acc2.gain_x"], {"prior": {"acc1.gain_x": 0.1}}),
        (["base.joint_rotation_x", "head.joint_rotation_x"], {}),
    ],
)
def test_a_tie_of_unlike_things_is_refused_by_name(specify, tie, more):
    with pytest.raises(InputError, match="cannot be tied") as caught:
        specify(ties=[tie], **more)
    assert all(name in str(caught.value) for name in tie)


def test_starts_vary_what_a_user_frees(model, campaign):
    whole = build_toleranced_model(model.machine, campaign)
    usual = parametrise(whole, campaign.tolerance)
    freed = parametrise(
        whole, campaign.tolerance, UserSpecification(free=["head.mass"], fix=["base_tx.*"])
    )
    names = [parameter.name for parameter in whole.parameters]
    moved = [
        {
            names[k]
            for k in np.flatnonzero(
                random_starts(whole, 2, 3, parametrisation=parametrisation)[1] != whole.drawn
            )
        }
        for parametrisation in (usual, freed)
    ]
    assert "head.mass" in moved[1] - moved[0]
    assert "base_tx.stiffness" in moved[0] - moved[1]
    assert moved[0] == {
        parameter.name
        for parameter in whole.parameters
        if parameter.known in ("stiffness", "damping")
    }
